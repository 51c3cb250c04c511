"""What cameras and arm may get wrong, one effect a file; each vanishes at its null, as those of the simulator do."""
