"""Interface of a planner, which decides on the next action for an observed object."""

from typing import Protocol

import numpy as np
from jaxtyping import Float32

from app.config import Site
from app.core.types import Centreline, Points, ToolPose
from app.planner.plan import Command, Plan, Ways


class Planner(Protocol):
    """Decision by simulation. Frozen, so that compiled code can be cached by it; P parameters of the simulator."""

    def __call__(
        self,
        observed: Points,
        goal: Points,
        phi: Float32[np.ndarray, " P"],
        *,
        seed: int,
        site: Site,
        tool: ToolPose | None = None,
        command: Command | None = None,
        rejected: Ways = (),
        near: Centreline | None = None,
    ) -> Plan:
        """Plan that brings the object `observed` (N, 3) [m] to `goal` (M, 3) [m], under the model `phi`.

        `tool`: its pose; None where actions begin anywhere. Without a `command` the arm is commanded the motion itself.
        `rejected`: first actions, by their tool paths, that are not proposed again while there is another. `near`: the
        nodes of a rope as the plan before predicted them [m]. The same `seed` decides the same on a CPU.

        Raises PlanningError if none of the candidates is finite and feasible.
        """
        ...

    def compile(self, example: Points, phi: Float32[np.ndarray, " P"]) -> None:
        """Compile for states and goals of the size of `example` (N, 3)."""
        ...
