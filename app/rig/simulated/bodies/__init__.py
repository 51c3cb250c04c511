"""Bodies in which effects are hidden: an object in the arrays of a MuJoCo model, as effects see it and act on it."""
