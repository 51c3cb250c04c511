"""Find where cameras stand: a board, a check, and the solution."""
