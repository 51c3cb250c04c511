"""Geometry without state: cameras, tables, tools and arms as plain data, and distances between points."""
