"""A motion that the operator changed: simulated while the plan that it is of stays up, and offered instead of it."""

from typing import TYPE_CHECKING, final

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.requests import EditRequest
from app.core.errors import PlanningError, WorkerError
from app.core.geometry.orientation import UNKNOWN, Orientation
from app.core.messages import Model, Particles, Proposal
from app.core.system.worker import Worker
from app.core.types import Centreline, Points
from app.jobs.edited import edited_plan
from app.tasks.elements.base import EpisodeConfig

if TYPE_CHECKING:  # The planner is loaded in its own process alone.
    from app.planner.search.plan import Plan


@final
class Editing:
    """Makes a plan of the latest change. Like any plan it is shown, approved and checked before the arm moves."""

    def __init__(self, wish: EpisodeConfig, announcer: MessageBus, planner: Worker, site: Site) -> None:
        self._task, self._preset, self._site = wish.task.name, wish.preset, site
        self._announcer, self._planner = announcer, planner
        self._wanted: tuple[EditRequest, Proposal] | None = None

    def wanted(self, request: EditRequest, proposal: Proposal | None) -> bool:
        """Note the operator's change of the plan that is up; False, with a notice, if it is of another."""
        if proposal is None or request.proposal_id != proposal.id:
            self._announcer.notice("edit", f"{request.proposal_id} is not the plan shown; edit the one that is.")
            return False
        self._wanted = request, proposal
        return True

    def answered(self) -> None:
        """Drop the change: the plan has been decided on, or is gone."""
        self._wanted = None

    async def plan(
        self,
        observed: Particles,
        goal: Points,
        model: Model,
        near: Centreline | None = None,
        orientation: Orientation = UNKNOWN,
    ) -> "Plan | None":
        """The changed motion for where the object is now; None where none is wanted, or it cannot be made.

        It is forgotten then, and in words is said why it cannot be made.
        """
        if self._wanted is None:
            return None
        (request, proposal), self._wanted = self._wanted, None
        index = proposal.best if request.branch < 0 else request.branch
        try:
            return await self._planner.run(
                *(edited_plan, self._task, self._preset, observed.positions, goal, model, proposal.branches, index),
                *(request.start, request.end, self._site, near, orientation),
            )
        except (PlanningError, WorkerError) as error:
            self._announcer.notice("edit", f"The edited motion cannot be offered. {error}")
            return None
