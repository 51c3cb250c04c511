"""Tools and fixtures of a cell, which own their geometry: callers ask the object, and match on no type."""
