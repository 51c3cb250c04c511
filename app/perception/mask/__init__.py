"""Masks of the object in images: by colour, or by a learned network."""
