"""What the simulation gets wrong, and why: from recordings to a named cause, an extended model and its gain."""
