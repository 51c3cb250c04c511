"""Search over trajectories: sample, roll out, descend, choose."""
