"""Diff-CEM-MPC: CEM whose samples take gradient steps between refits (Bharadhwaj et al. 2020; paper, baselines)."""

from app.planner.base import Planner
from app.planner.search.budget import SampleBudget
from app.planner.search.optimise import OptimizerConfig
from app.planner.search.sampling import SamplingPlanner
from app.planner.search.tree import TreeConfig
from app.planner.search.updates import Elites

GENERATIONS = 3
STEPS = 1
"""Gradient steps of each sample and generation. More would leave too few samples to fit a sequence's Gaussian."""
SMALLEST, LARGEST = 3, 128
"""Samples of a generation: two elites and one more; more than the largest, differentiated at once, become more
generations."""
ELITE_SHARE = 4
"""One in so many is an elite."""


def planner(search: TreeConfig, descent: OptimizerConfig, gradient_steps: int) -> Planner:
    """Generations that together simulate as much as the tree, or more where they would be smaller than `SMALLEST`."""
    size = SampleBudget.worth(
        search, gradient_steps, generations=GENERATIONS, largest=LARGEST, smallest=SMALLEST, steps=STEPS
    )
    elites = Elites(count=max(2, size.population // ELITE_SHARE))
    return SamplingPlanner.of(search, size, elites, descent, STEPS)
