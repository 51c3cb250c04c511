"""Diff-MPC: one trajectory of random actions, and nothing but gradient descent on it (paper, baselines)."""

from dataclasses import replace

from app.planner.base import Planner
from app.planner.search.budget import SLOPE_ROLLOUTS, at_least, tree_rollouts
from app.planner.search.optimise import OptimizerConfig
from app.planner.search.plan import TreePlanner
from app.planner.search.tree import TreeConfig


def planner(search: TreeConfig, descent: OptimizerConfig, gradient_steps: int) -> Planner:
    """A tree of one branch without a policy, with as many gradient steps as the tree takes altogether."""
    steps = at_least(tree_rollouts(search, gradient_steps), SLOPE_ROLLOUTS)
    alone = replace(search, branches=1, guided=False, descended=None, redraws=())
    return TreePlanner(search=alone, descent=descent, gradient_steps=steps)
