"""MPPI: model-predictive path integral control, sampling and reweighing alone (Williams et al. 2017; a baseline)."""

from app.planner.base import Planner
from app.planner.search.budget import SampleBudget
from app.planner.search.optimise import OptimizerConfig
from app.planner.search.sampling import SamplingPlanner
from app.planner.search.tree import TreeConfig
from app.planner.search.updates import PathIntegral

GENERATIONS = 5
"""As many as of CEM-MPC: each decision begins anew, where controllers of many hertz take a generation a step."""
LARGEST = 256
"""Samples that are simulated at once; more of them become more generations."""


def planner(search: TreeConfig, descent: OptimizerConfig, gradient_steps: int) -> Planner:
    """`GENERATIONS` of a population that together simulate as much as the tree, or more generations of `LARGEST`."""
    size = SampleBudget.worth(search, gradient_steps, generations=GENERATIONS, largest=LARGEST)
    return SamplingPlanner.of(search, size, PathIntegral(), descent)
