"""Stopping rule of automatic motion: plans in a row that are no better than no motion end it."""

from typing import Final, final

from app.core.announcer import MessageBus
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Proposal
from app.core.types import Points
from app.tasks.elements.base import EpisodeConfig

_FUTILE_PLANS: Final = 2
"""Plans in a row, each with other random branches, that end a run if they are no better than no motion."""
_GAIN: Final = 0.05
"""Share of the Chamfer distance by which a branch has to bring the object nearer where it costs more than no motion:
what contact costs is there to find the object, and no reason to leave off."""
EXHAUSTED: Final = "no motion promises to bring the object nearer to its goal"


@final
class StoppingRule:
    """Counts plans in a row that are no better than no motion, by the model.

    Only where each motion of the task ends at rest: of a longer sequence, what it costs so far says nothing. A policy
    that acts without a planner is not weighed.
    """

    def __init__(self, wish: EpisodeConfig, announcer: MessageBus) -> None:
        self._weighs = wish.task.at_rest and not wish.method.alone
        self._announcer = announcer
        self._futile = 0

    @property
    def exhausted(self) -> bool:
        """True if another plan would hardly fare better."""
        return self._futile >= _FUTILE_PLANS

    def admits(self, proposal: Proposal, goal: Points) -> bool:
        """True if the motion is worth making on the way to `goal` (M, 3) [m]; otherwise that is announced."""
        if not self._weighs or proposal.is_improvement or _brings_nearer(proposal, goal):
            self._futile = 0
            return True
        # What was exhausted begins anew: somebody has chosen to go on.
        self._futile = 1 if self.exhausted else self._futile + 1
        said = "The best motion found is no better than none, by the model; it is not made."
        self._announcer.notice("plan", said, proposal.id)
        return False


def _brings_nearer(proposal: Proposal, goal: Points) -> bool:
    """True where all actions of the branch that is followed bring the object nearer by a share that counts.

    By the distance of its task too, where the plan says so: against a wall, the Chamfer distance is no way.
    """
    before, after = chamfer_m2(proposal.observed, goal), chamfer_m2(proposal.chosen.final, goal)
    return bool(after < (1 - _GAIN) * before and proposal.chosen.terms.get("progress", after - before) < 0)
