"""DiPac: the paper's tree of trajectories, optimised along their gradients."""

from app.planner.base import Planner
from app.planner.optimise import Descent
from app.planner.plan import TreePlanner
from app.planner.tree import Search


def planner(search: Search, descent: Descent, gradient_steps: int) -> Planner:
    """The tree itself."""
    return TreePlanner(search=search, descent=descent, gradient_steps=gradient_steps)
