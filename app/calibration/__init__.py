"""Gradient-based estimation of physical parameters from transitions."""
