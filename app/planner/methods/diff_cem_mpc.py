"""Diff-CEM-MPC: CEM whose samples take gradient steps between refits (Bharadhwaj et al. 2020; paper, baselines)."""

from dataclasses import replace

from app.planner.base import Planner
from app.planner.search.budget import at_least, generation_rollouts, tree_rollouts
from app.planner.search.cem import CemPlanner, Refit
from app.planner.search.optimise import OptimizerConfig
from app.planner.search.tree import TreeConfig

GENERATIONS = 3
STEPS = 1
"""Gradient steps of each sample and generation. More would leave too few samples to fit a sequence's Gaussian."""
SMALLEST, LARGEST = 16, 128
"""Samples of a generation: fewer are no population; more, differentiated at once, become more generations."""
ELITE_SHARE = 4
"""One in so many is an elite."""


def planner(search: TreeConfig, descent: OptimizerConfig, gradient_steps: int) -> Planner:
    """Generations that together simulate as much as the tree, or more where they would be smaller than `SMALLEST`."""
    rollouts, each = tree_rollouts(search, gradient_steps), generation_rollouts(STEPS)
    generations = max(GENERATIONS, at_least(rollouts, LARGEST * each))
    population = max(SMALLEST, at_least(rollouts, generations * each))
    kept = min(search.branches, population)
    return CemPlanner(
        search=replace(search, branches=population, guided=False),
        refit=Refit(generations=generations, elites=max(2, population // ELITE_SHARE), kept=kept),
        descent=descent,
        gradient_steps=STEPS,
    )
