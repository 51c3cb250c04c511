"""Errors of cameras and arm, one effect a file; each vanishes at its null, as those of the simulator do."""
