"""Plans made ahead: while the arm moves, for where the object is predicted to lie then, and taken if it does.

What a predictive controller plans is applied later than its state was measured; to plan for the state predicted for
that later time makes up for it (Findeisen and Allgoewer 2004, "Computational delay in nonlinear model predictive
control").
"""

from dataclasses import dataclass, replace
from typing import final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float32

from app.core.errors import PlanningError
from app.core.messages import Origin
from app.core.types import Points
from app.planner.base import Planner
from app.planner.search.optimise import OptimizedRollouts
from app.planner.search.plan import Plan, choose
from app.planner.search.request import Ahead, PlanRequest
from app.planner.search.rollout_frames import resimulate
from app.planner.search.tree import TreeConfig, roots, situation

_KEPT = 0.9
"""Share of its promise that a plan made ahead has to keep where the object truly came to lie."""


@final
@dataclass(frozen=True, kw_only=True)
class AheadPlanner:
    """A planner that takes the plan of `PlanRequest.ahead` where that holds, and plans anew elsewhere.

    It holds if its actions, simulated again from where the object was seen, may be made and promise nine tenths of what
    they did: by so much of its cost, which was below the 0 of no motion, one of them still costs less than that. That
    takes one simulation of each branch, and no gradients.
    """

    planner: Planner
    search: TreeConfig

    def __call__(self, request: PlanRequest) -> Plan:
        """Plan as requested. Raises PlanningError as the planner does."""
        again = replace(request, ahead=None)
        return (self._taken(request.ahead, again) if request.ahead else None) or self.planner(again)

    def compile(self, example: Points, phi: Float32[np.ndarray, " P"]) -> None:
        """Compile the planner. What is simulated again is compiled as it is first asked for."""
        self.planner.compile(example, phi)

    def _taken(self, ahead: Ahead, request: PlanRequest) -> Plan | None:
        """The plan made ahead, for the object where it is; None where it does not hold."""
        actions = jnp.stack([jnp.asarray(branch.actions) for branch in ahead.branches])
        phi, now = roots(request, situation(self.search, request), len(actions))
        again = resimulate(self.search, phi, now, jnp.asarray(request.goal), actions)
        found = jax.device_get(OptimizedRollouts.from_samples(again.rollout, again.rollout.cost[None]))
        origins: list[Origin] = [branch.origin for branch in ahead.branches]
        try:
            plan = choose(self.search, found, origins, request, seen=again.moments)
        except PlanningError:
            return None
        if not plan.branches[plan.best].cost_after <= -_KEPT * ahead.promise_m2 < 0.0:
            return None
        return replace(plan, ahead=True)
