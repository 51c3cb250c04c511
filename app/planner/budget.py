"""How much a decision simulates, so that what is compared has simulated as much."""

from math import ceil

from app.planner.tree import Search

SLOPE_ROLLOUTS = 6
"""A rollout with its gradient takes at most as long as so many without: 5.5 on two CPU cores, 2.5 on a GPU
(docs/results.md, "The simulator"). Rounded up, as whoever samples alone shall not get less time than the tree."""


def tree_rollouts(search: Search, gradient_steps: int) -> int:
    """What the paper's tree simulates for a decision: rollouts of one candidate over the whole depth, forwards only.

    Every branch is grown by the policy once (all but the last of its actions; counted as all), differentiated once a
    gradient step, and simulated once more at the end.
    """
    return search.branches * (2 + SLOPE_ROLLOUTS * gradient_steps)


def generation_rollouts(gradient_steps: int) -> int:
    """What a generation simulates of each of its samples: the slopes of its steps, and where they led."""
    return 1 + SLOPE_ROLLOUTS * gradient_steps


def at_least(rollouts: int, each: int) -> int:
    """The fewest pieces of `each` rollouts that are as many as `rollouts` or more."""
    return ceil(rollouts / each)
