"""The approval gate: the only place where an `Approved` is made, and an arm executes nothing else.

Exactly the motion that was shown is approved, by its digest; the gate refuses when the plan is old or the object has
moved since it was planned. (MoveIt learned the same: moveit_ros #709, #710.)
"""

import secrets
from dataclasses import dataclass, field
from typing import Final, final

import numpy as np

from app.core.errors import ApprovalRefused
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Decision, Message, MessageId, Particles, Proposal, fresh_id
from app.core.motion import Motion

AUTOMATIC: Final = "automatic"
"""Operator name recorded for automatic approvals."""
_SEAL = secrets.token_hex(16)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Approved(Message):
    """Leave to execute one motion once. Made by `ApprovalGate.approve` alone."""

    proposal_id: MessageId
    motion: Motion
    digest: str
    operator: str
    seal: str = field(repr=False)

    def __post_init__(self) -> None:
        if self.seal != _SEAL:
            raise ApprovalRefused("Only the approval gate makes an Approved; send a Decision to it instead.")
        if self.digest != self.motion.digest():
            raise ApprovalRefused("The motion is not the one that was approved; plan and approve again.")


@final
class ApprovalGate:
    """Gate that holds the one proposal on display and turns a decision on it into an `Approved`.

    A proposal is refused where its plan is older than `max_age_s`, where the object was last seen `max_unseen_s` ago or
    earlier (it may have moved unseen), and where the object has moved by more than `max_drift_m` (root of half the
    squared Chamfer distance between the planned-from and the latest particles).
    """

    def __init__(self, *, max_age_s: float, max_unseen_s: float, max_drift_m: float) -> None:
        self._max_age_s = max_age_s
        self._max_unseen_s = max_unseen_s
        self._max_drift_m = max_drift_m
        self._shown: Proposal | None = None

    def show(self, proposal: Proposal | None) -> None:
        """Make `proposal` the only one that can be approved (None: nothing can)."""
        self._shown = proposal

    def approve(self, decision: Decision, *, latest: Particles, now_s: float) -> Approved:
        """The approved motion of the shown proposal; it is consumed.

        Raises ApprovalRefused with the reason in words.
        """
        shown = self._shown
        if not decision.approve:
            raise ApprovalRefused("The plan was rejected; a rejection approves nothing.")
        if shown is None or decision.proposal_id != shown.id:
            raise ApprovalRefused("That plan is no longer the one shown; look at the new one and decide on it.")
        if decision.digest != shown.motion.digest():
            raise ApprovalRefused("The approved motion is not the motion shown; reload the console and decide again.")
        age_s = now_s - shown.time_s
        if not age_s <= self._max_age_s:
            raise ApprovalRefused(f"The plan is {age_s:.0f} s old (limit {self._max_age_s:.0f} s); wait for a new one.")
        unseen_s = now_s - latest.time_s
        if not unseen_s <= self._max_unseen_s:
            raise ApprovalRefused(
                f"The object was last seen {unseen_s:.0f} s ago (limit {self._max_unseen_s:.0f} s); see the cameras."
            )
        drift_m = drift(shown.observed, latest.positions)
        if not drift_m <= self._max_drift_m:
            raise ApprovalRefused(
                f"The object has moved by {drift_m * 1e3:.0f} mm since this was planned "
                f"(limit {self._max_drift_m * 1e3:.0f} mm); wait for a new plan."
            )
        self._shown = None
        return Approved(
            id=fresh_id("approved"),
            cause=(shown.id, decision.id),
            time_s=now_s,
            proposal_id=shown.id,
            motion=shown.motion,
            digest=decision.digest,
            operator=decision.operator,
            seal=_SEAL,
        )


def automatic_decision(proposal: Proposal, *, now_s: float) -> Decision:
    """Approving decision of a mode without an operator. A session that begins in that mode needs a simulated rig."""
    return Decision(
        id=fresh_id("decision"),
        cause=(proposal.id,),
        time_s=now_s,
        proposal_id=proposal.id,
        digest=proposal.motion.digest(),
        approve=True,
        operator=AUTOMATIC,
    )


def drift(a: np.ndarray, b: np.ndarray) -> float:
    """Distance between two clouds of the same object [m]: the root of their mean one-way squared distance."""
    return float(np.sqrt(chamfer_m2(a, b) / 2))
