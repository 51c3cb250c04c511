"""The hidden-effect suite: recordings with something hidden in them, a solver that sees these alone, and its score."""
