"""Results of an episode, in numbers."""

from dataclasses import dataclass, field
from typing import final

from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Executed, Outcome, Particles, Proposal, fresh_id
from app.core.types import Points


@final
@dataclass(kw_only=True)
class Summary:
    """Accumulated results of a running episode. `chamfer_m2` holds the start and then one value after each push.

    `last_chamfer_m2` is of the last observation: it differs where a push was stopped, which is not scored. `reached`:
    True where the last observation met the goal; `exhausted`: True where the episode ended early because the model
    predicted no motion better than none. `said`: messages to be recorded; `reconstruction_latency_s` is from exposure
    to particles.
    """

    chamfer_m2: list[float] = field(default_factory=list[float])
    predicted_chamfer_m2: list[float] = field(default_factory=list[float])
    decision_s: list[float] = field(default_factory=list[float])
    cost_before: list[float] = field(default_factory=list[float])
    cost_after: list[float] = field(default_factory=list[float])
    reconstruction_latency_s: list[float] = field(default_factory=list[float])
    faults: list[str] = field(default_factory=list[str])
    last_chamfer_m2: float | None = None
    first_push_s: float | None = None
    reached: bool = False
    exhausted: bool = False
    said: int = 0

    @property
    def pushes(self) -> int:
        """Number of finished pushes."""
        return len(self.decision_s)

    def began_moving(self, since_start_s: float) -> None:
        """Note the time of the first push."""
        if self.first_push_s is None:
            self.first_push_s = since_start_s

    def saw(self, observed: Particles, goal: Points) -> None:
        """Note the object's distance from the goal."""
        self.last_chamfer_m2 = float(chamfer_m2(observed.positions, goal))
        if not self.chamfer_m2:
            self.chamfer_m2.append(self.last_chamfer_m2)

    def score(
        self, proposal: Proposal, before: Particles, executed: Executed, after: Particles, goal: Points, *, now_s: float
    ) -> Outcome:
        """Append one push and return its outcome: `before` is the observation its approval was checked against."""
        outcome = Outcome(
            id=fresh_id("outcome"),
            cause=(proposal.id, executed.id, after.id),
            time_s=now_s,
            index=self.pushes + 1,
            chamfer_before_m2=float(chamfer_m2(before.positions, goal)),
            predicted_chamfer_m2=proposal.predicted_chamfer_m2,
            chamfer_after_m2=float(chamfer_m2(after.positions, goal)),
            cost_before=proposal.chosen.cost_before,
            cost_after=proposal.chosen.cost_after,
            plan_s=proposal.plan_s,
            model_version=proposal.model_version,
        )
        self.chamfer_m2.append(outcome.chamfer_after_m2)
        self.predicted_chamfer_m2.append(outcome.predicted_chamfer_m2)
        self.decision_s.append(outcome.plan_s)
        self.cost_before.append(outcome.cost_before)
        self.cost_after.append(outcome.cost_after)
        return outcome
