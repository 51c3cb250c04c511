"""Three-dimensional view: the scene, clouds, beads, paths and the tool."""
