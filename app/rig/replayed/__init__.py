"""Cameras that replay the images of a recording."""
