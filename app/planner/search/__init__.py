"""Search: the tree of trajectories, its costs, gradient descent, cross-entropy, and the plan that comes of it."""
