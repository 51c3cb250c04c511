"""Cameras that show again what cameras saw when a recording was made."""
