"""Failures of a simulation: bad input by name, the first bad step, and a file that shows it."""
