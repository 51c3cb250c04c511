"""Diagnosis of the simulation's errors: from recordings to a named cause, an extended model and its gain."""
