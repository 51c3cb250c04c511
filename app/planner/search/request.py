"""The request to a planner: an object, its goal, a model, and all else that bears on one decision."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float32

from app.config import Site
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Branch
from app.core.motion import Motion
from app.core.types import Centreline, Points, ToolPose

Command: TypeAlias = Callable[[Motion, Points, Points], Motion]
"""Compensation of an arm's errors: the command for a motion that it is to make, given the particles before and
after it."""
Ways: TypeAlias = Sequence[Float32[np.ndarray, "_ 3"]]
"""Tool paths [m], each of its own length."""
Actions: TypeAlias = Float32[np.ndarray, "L A"]
"""Actions one after another, in a task's action space."""

_SEEN_M2 = 2 * 0.005**2
"""Chamfer distance [m^2] of two observations of an object that lay still: noise, and where particles happen to be."""


_SMALL = 0.1
"""Share of what a plan made ahead promises by which the object may lie elsewhere than predicted."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Ahead:
    """A plan made while the arm moved, for particles `predicted` (N, 3) [m] to lie there then: its branches.

    `best`: the index of the one that it would have followed.
    """

    predicted: Points
    branches: Sequence[Branch]
    best: int

    @property
    def promise_m2(self) -> float:
        """Cost below that of no motion, which is 0 [m^2]."""
        return -self.branches[self.best].cost_after

    def came_true(self, observed: Points) -> bool:
        """True if the object is seen (N, 3) [m] as near to where it was predicted (Chamfer) as this plan needs it."""
        return float(chamfer_m2(self.predicted, observed)) <= _SMALL * self.promise_m2


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class PlanRequest:
    """One decision to be made: bring the object `observed` (N, 3) [m] to `goal` (M, 3) [m], under the model `phi`.

    `tool`: its pose; None where actions begin anywhere; `told_tool`: that pose by the arm's own account, where the arm
    errs. Without a `command` the arm is commanded the motion itself.
    `rejected`: first actions, by their tool paths, that are not proposed again while there is another. `near`: the
    nodes of a rope as the plan before predicted them [m]. `remainder`: the actions with which that plan was to go on
    (`remainder_of`), from which this one starts too. `ahead`: a plan made ahead, which is taken if it holds
    (`app.planner.search.ahead`). The same `seed` decides the same on a CPU.
    """

    observed: Points
    goal: Points
    phi: Float32[np.ndarray, " P"]
    seed: int = 0
    site: Site = field(default_factory=Site)
    tool: ToolPose | None = None
    told_tool: ToolPose | None = None
    command: Command | None = None
    rejected: Ways = ()
    near: Centreline | None = None
    remainder: Actions | None = None
    ahead: Ahead | None = None


def remainder_of(branch: Branch, before: Points, now: Points) -> Actions | None:
    """The later actions of a branch whose first was made, from `before` to `now`, particles (N, 3) as observed [m].

    None where there are none, or the prediction did not come true: the object is farther from it (Chamfer) than from
    where it was, and than two observations of one object are.
    """
    wrong_m2, moved_m2 = (float(chamfer_m2(x, now)) for x in (branch.predicted, before))
    return branch.actions[1:] if len(branch.actions) > 1 and wrong_m2 <= max(moved_m2, _SEEN_M2) else None
