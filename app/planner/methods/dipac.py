"""DiPac: the paper's tree of trajectories, optimised along their gradients."""

from app.planner.base import Planner
from app.planner.search.optimise import OptimizerConfig
from app.planner.search.plan import TreePlanner
from app.planner.search.tree import TreeConfig


def planner(search: TreeConfig, descent: OptimizerConfig, gradient_steps: int) -> Planner:
    """The tree itself."""
    return TreePlanner(search=search, descent=descent, gradient_steps=gradient_steps)
