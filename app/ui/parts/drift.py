"""Motion of the object since the pending plan was made, as the approval gate will check it."""

import math
from dataclasses import dataclass
from typing import final

from app.config import Timing
from app.core.dialogue.approval import drift
from app.core.messages import Particles, Proposal
from app.ui.parts.console_state import ConsoleState


@final
@dataclass(frozen=True, kw_only=True)
class Moved:
    """Drift since a plan was made, NaN while nothing is pending; the other two are the limits that refuse a plan."""

    drift_m: float
    max_drift_m: float
    max_age_s: float

    @property
    def share(self) -> float:
        """Share of the allowed drift."""
        return self.drift_m / self.max_drift_m


@final
class DriftMeter:
    """Drift computed once for every plan and observation, as it takes milliseconds. For the painter's thread alone."""

    def __init__(self, timing: Timing) -> None:
        self._timing = timing
        self._pair: tuple[Proposal | None, Particles | None] = (None, None)
        self._drift_m = math.nan

    def since(self, state: ConsoleState) -> Moved:
        """Motion of the object since its pending plan was made."""
        pair = state.pending, state.particles
        if pair[0] is not self._pair[0] or pair[1] is not self._pair[1]:
            self._pair = pair
            plan, seen = pair
            self._drift_m = drift(plan.observed, seen.positions) if plan and seen else math.nan
        timing = self._timing
        return Moved(drift_m=self._drift_m, max_drift_m=timing.plan_max_drift_m, max_age_s=timing.plan_max_age_s)
