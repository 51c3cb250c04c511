"""Cameras of the simulated cell: what they see, rendered in processes of their own."""
