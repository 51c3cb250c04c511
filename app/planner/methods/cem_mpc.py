"""CEM-MPC: sampling and refitting alone, without gradients and without a policy (paper, baselines)."""

from dataclasses import replace

from app.planner.base import Planner
from app.planner.search.budget import at_least, generation_rollouts, tree_rollouts
from app.planner.search.cem import CemPlanner, Refit
from app.planner.search.optimise import OptimizerConfig
from app.planner.search.tree import TreeConfig

GENERATIONS = 5
LARGEST = 256
"""Samples that are simulated at once; more of them become more generations."""
ELITE_SHARE = 8
"""One in so many is an elite."""


def planner(search: TreeConfig, descent: OptimizerConfig, gradient_steps: int) -> Planner:
    """`GENERATIONS` of a population that together simulate as much as the tree, or more generations of `LARGEST`."""
    rollouts, each = tree_rollouts(search, gradient_steps), generation_rollouts(0)
    generations = max(GENERATIONS, at_least(rollouts, LARGEST * each))
    population = at_least(rollouts, generations * each)
    kept = min(search.branches, population)
    refit = Refit(generations=generations, elites=max(2, population // ELITE_SHARE), kept=kept)
    return CemPlanner(search=replace(search, branches=population, guided=False), refit=refit, descent=descent)
