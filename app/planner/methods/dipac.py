"""DiPac: the paper's tree of trajectories, optimised along their gradients."""

from app.planner.base import Planner
from app.planner.search.optimise import Descent
from app.planner.search.plan import TreePlanner
from app.planner.search.tree import Search


def planner(search: Search, descent: Descent, gradient_steps: int) -> Planner:
    """The tree itself."""
    return TreePlanner(search=search, descent=descent, gradient_steps=gradient_steps)
