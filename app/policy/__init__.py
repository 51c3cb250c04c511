"""Initial policies that guide the tree."""
