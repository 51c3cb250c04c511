"""Motions that discovery asks for as plans, for the object and the tool where they are now."""
