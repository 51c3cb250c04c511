"""What can be wrong in the simulated world without a model's knowing, one effect a file, in MuJoCo's own terms."""
