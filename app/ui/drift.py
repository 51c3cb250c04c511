"""How far the object has moved since the pending plan was made: what the approval gate will look at."""

import math
from dataclasses import dataclass
from typing import final

from app.config import Timing
from app.core.approval import drift
from app.core.messages import Particles, Proposal
from app.ui.board import Board


@final
@dataclass(frozen=True, kw_only=True)
class Moved:
    """`drift_m` since a plan was made, NaN while nothing is pending; a plan is refused by the other two."""

    drift_m: float
    max_drift_m: float
    max_age_s: float

    @property
    def share(self) -> float:
        """Of what is allowed."""
        return self.drift_m / self.max_drift_m


@final
class Drift:
    """Takes the distance once for every plan and sighting: that takes milliseconds. For the painter's thread alone."""

    def __init__(self, timing: Timing) -> None:
        self._timing = timing
        self._pair: tuple[Proposal | None, Particles | None] = (None, None)
        self._drift_m = math.nan

    def since(self, board: Board) -> Moved:
        """How far the object of the board has moved since the plan that is pending there was made."""
        pair = board.pending, board.particles
        if pair[0] is not self._pair[0] or pair[1] is not self._pair[1]:
            self._pair = pair
            plan, seen = pair
            self._drift_m = drift(plan.observed, seen.positions) if plan and seen else math.nan
        timing = self._timing
        return Moved(drift_m=self._drift_m, max_drift_m=timing.plan_max_drift_m, max_age_s=timing.plan_max_age_s)
