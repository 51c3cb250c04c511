"""The line of a rope: particles in order along it, its centreline, and how far that can be believed."""
