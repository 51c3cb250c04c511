"""Policies learned from demonstrations: observations, training, and one file for each kind."""
