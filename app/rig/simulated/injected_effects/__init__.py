"""Injected effects: errors of the simulated world unknown to the model, one a file, in MuJoCo's own terms."""
