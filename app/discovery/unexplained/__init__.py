"""The part that no cause of the catalogue explains: the residual test, and formulas of forces."""
