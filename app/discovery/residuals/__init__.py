"""Differences between predictions and observations, and their slopes with respect to every cause."""
