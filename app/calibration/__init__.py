"""Physical parameters from transitions, by gradient."""
