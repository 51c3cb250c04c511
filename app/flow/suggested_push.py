"""Suggested pushes, such as the next one of a discovery: each is proposed until it has been decided on."""

from typing import TYPE_CHECKING, final

import numpy as np

from app.config import Site
from app.core.announcer import MessageBus
from app.core.errors import PlanningError, WorkerError
from app.core.geometry.orientation import UNKNOWN, Orientation
from app.core.messages import Model, Particles
from app.core.motion import Motion
from app.core.system.worker import Worker
from app.core.types import Centreline, Points
from app.flow.probing import Probing
from app.jobs.suggested_push import plan_of_suggestion
from app.tasks.elements.base import EpisodeConfig

if TYPE_CHECKING:  # The planner is loaded in its own process alone.
    from app.planner.search.plan import Plan

_MOVED_M = 1e-3


@final
class Asking:
    """Makes plans of the wish's pushes, and of those that `probing` chooses.

    Like any plan they are shown, approved and checked before the arm moves.
    """

    def __init__(
        self, wish: EpisodeConfig, announcer: MessageBus, planner: Worker, site: Site, probing: Probing
    ) -> None:
        self._task, self._site = wish.task.name, site
        self._announcer, self._planner = announcer, planner
        self._motions, self._probing = wish.asked, probing

    def answered(self) -> None:
        """The one that was offered has been decided on, and is not offered again."""
        self._motions = self._motions[1:]

    async def plan(
        self,
        observed: Particles,
        goal: Points,
        model: Model,
        near: Centreline | None = None,
        orientation: Orientation = UNKNOWN,
    ) -> "Plan | None":
        """The next push, aimed at where the object is now; None where none is asked for, or it does not fit here.

        Raises PlanningError where an experiment finds no push.
        """
        asked, x = self._motions[:1], observed.positions
        motion = asked[0] if asked else await self._probing.motion(observed)
        if motion is None:
            return None
        try:
            found = await self._planner.run(
                plan_of_suggestion, self._task, x, goal, model, motion, self._site, near, orientation
            )
        except (PlanningError, WorkerError) as error:
            self.answered()
            self._announcer.notice("discovery", f"The push that discovery asks for cannot be offered: {error}")
            return None
        self._announcer.notice("discovery", _about(motion, found.motion))
        return found


def _about(wanted: Motion, offered: Motion) -> str:
    apart_m = float(np.linalg.norm((offered.positions[0] - wanted.positions[0])[:2]))
    if apart_m < _MOVED_M:
        return "Offered: the push that discovery asks for, as it asks for it."
    return (
        f"Offered: the push that discovery asks for, moved by {apart_m * 1e3:.0f} mm to where the object lies now. Its "
        "direction, length and speed are as asked."
    )
