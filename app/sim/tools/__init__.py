"""Collision shapes that touch objects: tools that follow a path, and fixtures; one shape a file."""
