"""RGB-D images to particles, as pure functions."""
