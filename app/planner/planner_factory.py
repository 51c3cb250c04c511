"""Makes the planner that a method names."""

import importlib
from dataclasses import replace

from app.planner import methods
from app.planner.base import Planner
from app.planner.method import Method
from app.planner.search.optimise import OptimizerConfig
from app.planner.search.tree import TreeConfig


def make_planner(method: Method, search: TreeConfig, descent: OptimizerConfig, gradient_steps: int) -> Planner:
    """The planner for a task's search, as sized by its preset, with the method's ablations.

    Where nothing is chosen and nothing optimised, only the action that is executed is simulated.
    Raises TypeError where the planner's file defines no `planner`.
    """
    chosen = replace(
        search,
        guided=method.guided,
        branches=search.branches if method.branching else 1,
        depth=search.depth if method.branching or method.descending else 1,
        redraws=search.redraws if method.branching else (),
    )
    build = getattr(importlib.import_module(f"{methods.__name__}.{method.planner}"), "planner", None)
    if build is None:
        raise TypeError(
            f"app/planner/methods/{method.planner}.py must define planner(search, descent, gradient_steps)."
        )
    return build(chosen, descent, gradient_steps if method.descending else 0)
