"""Simulation budget of a decision, so that methods are compared at equal cost."""

from math import ceil
from typing import NamedTuple

from app.planner.search.tree import TreeConfig, descended_count

SLOPE_ROLLOUTS = 6
"""A rollout with its gradient takes at most as long as so many without: 5.5 on two CPU cores, 2.5 on a GPU
(docs/results.md, "The simulator"). Rounded up, as whoever samples alone shall not get less time than the tree."""


def tree_rollouts(search: TreeConfig, gradient_steps: int) -> int:
    """Rollouts of the paper's tree for a decision: of one candidate over the whole depth, forwards only.

    Every branch is simulated as it is grown; each redraw simulates all once more; those that are descended from are
    differentiated once a gradient step, and simulated once more at the end. What is simulated for display alone
    does not count.
    """
    grown, descended = search.branches, descended_count(search)
    if not gradient_steps:
        return grown
    return grown * (1 + len(search.redraws)) + descended * (1 + SLOPE_ROLLOUTS * gradient_steps)


def generation_rollouts(gradient_steps: int) -> int:
    """Rollouts of a generation for each of its samples: the slopes of its steps, and the final one."""
    return 1 + SLOPE_ROLLOUTS * gradient_steps


class SampleBudget(NamedTuple):
    """Generations of a population that together simulate at least as much as the tree."""

    generations: int
    population: int

    @classmethod
    def worth(
        cls,
        search: TreeConfig,
        gradient_steps: int,
        *,
        generations: int,
        largest: int,
        smallest: int = 1,
        steps: int = 0,
    ) -> "SampleBudget":
        """At least so many generations, and more where `largest` samples, each with its `steps`, are too few."""
        rollouts, each = tree_rollouts(search, gradient_steps), generation_rollouts(steps)
        generations = max(generations, at_least(rollouts, largest * each))
        return cls(generations, max(smallest, at_least(rollouts, generations * each)))


def at_least(rollouts: int, each: int) -> int:
    """The fewest pieces of `each` rollouts that make up `rollouts` or more."""
    return ceil(rollouts / each)
