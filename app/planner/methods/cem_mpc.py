"""CEM-MPC: sampling and refitting alone, without gradients and without a policy (paper, baselines)."""

from app.planner.base import Planner
from app.planner.search.budget import SampleBudget
from app.planner.search.optimise import OptimizerConfig
from app.planner.search.sampling import SamplingPlanner
from app.planner.search.tree import TreeConfig
from app.planner.search.updates import Elites

GENERATIONS = 5
LARGEST = 256
"""Samples that are simulated at once; more of them become more generations."""
ELITE_SHARE = 8
"""One in so many is an elite."""


def planner(search: TreeConfig, descent: OptimizerConfig, gradient_steps: int) -> Planner:
    """`GENERATIONS` of a population that together simulate as much as the tree, or more generations of `LARGEST`."""
    size = SampleBudget.worth(search, gradient_steps, generations=GENERATIONS, largest=LARGEST)
    elites = Elites(count=max(2, size.population // ELITE_SHARE))
    return SamplingPlanner.of(search, size, elites, descent)
