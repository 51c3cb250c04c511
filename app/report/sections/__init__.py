"""Sections of the report, a file each, from the masthead to the next push."""
