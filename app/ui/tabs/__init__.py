"""Tabs of the console, one a file."""
