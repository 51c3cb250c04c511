"""Ropes as rods: a discrete elasto-plastic rod that a finger pushes over a table."""
