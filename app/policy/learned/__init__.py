"""Policies learned from demonstrations: what they see, how they learn, and one file for each kind."""
