"""Interface of a planner, which decides on the next action for an observed object."""

from typing import Protocol

import numpy as np
from jaxtyping import Float32

from app.core.types import Points
from app.planner.search.plan import Plan
from app.planner.search.request import PlanRequest


class Planner(Protocol):
    """Decision by simulation. Frozen, so that compiled code can be cached by it; P parameters of the simulator."""

    def __call__(self, request: PlanRequest) -> Plan:
        """Plan as requested. Raises PlanningError if none of the candidates is finite and feasible."""
        ...

    def compile(self, example: Points, phi: Float32[np.ndarray, " P"]) -> None:
        """Compile for states and goals of the size of `example` (N, 3)."""
        ...
