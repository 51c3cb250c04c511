"""Motions that are not the planner's: those that a discovery asks for, and pushes that an experiment chooses."""

from collections.abc import Callable
from dataclasses import replace
from typing import TYPE_CHECKING, final

import numpy as np

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.requests import ProbeRequest
from app.core.errors import PlanningError, WorkerError
from app.core.geometry.orientation import UNKNOWN, Orientation
from app.core.geometry.track import Track
from app.core.messages import Model, Particles, Transition, fresh_id
from app.core.motion import Motion
from app.core.ports import Clock, Computer
from app.core.types import Centreline, Points, ToolPose
from app.jobs.probed import Chosen, Weighed, belief_after, chosen_motion, experiment_refusal
from app.jobs.worker_api import plan_of_suggestion
from app.session.perception_stage import Sensing
from app.tasks.elements.base import EpisodeConfig, Experiment

if TYPE_CHECKING:  # The planner and the simulator are loaded in the planner's process alone.
    from app.discovery.dataset.study import Push
    from app.planner.search.plan import Plan

_MOVED_M = 1e-3
_TURNED = 1e-5
"""One minus the cosine of half an angle, half a degree, within which orientations are the same."""


@final
class Probing:
    """Chooses the pushes of the episode's experiment in the planner's process, and weighs causes after each batch."""

    def __init__(
        self,
        config: EpisodeConfig,
        planner: Computer,
        site: Site,
        sensing: Sensing,
        announcer: MessageBus,
        clock: Clock,
    ) -> None:
        self._task, self._seed, self._experiment = config.task, config.seed, config.experiment
        self._opening = config.opening
        self._planner, self._site, self._sensing = planner, site, sensing
        self._announcer, self._clock = announcer, clock
        self._made, self._draws = list["Push"](), 0
        self._held: Weighed | None = None
        self._offered: Chosen | None = None
        self._over = ""

    @property
    def active(self) -> bool:
        """True if further pushes are chosen."""
        return self._experiment is not None

    def handle(self, request: ProbeRequest, interrupt: Callable[[str], object]) -> None:
        """Begin an experiment of so many pushes more, or end it; `interrupt` voids the plan shown, with the reason."""
        if request.pushes <= 0:
            self._experiment = None
            interrupt("is of an experiment, and plans are for the goal again")
            return
        if refused := experiment_refusal(self._task):
            self._announcer.notice("experiment", refused, request.id)
            return
        self._experiment = Experiment(budget=len(self._made) + request.pushes)
        interrupt("is for the goal, and pushes are chosen now for what they say about the model")

    def conclusion(self) -> str:
        """The reason of its end, once; empty while it lasts. Afterwards plans are made as usual."""
        over, self._over = self._over, ""
        return over

    async def motion(self, observed: Particles) -> Motion | None:
        """The next push for the object where it is; None where there is no experiment.

        Raises PlanningError where none may be made.
        """
        experiment = self._experiment
        if experiment is None:
            return None
        if self._held is None:
            self._held = await self._planner.run(belief_after, self._task.name, (), experiment.budget)
        self._draws += 1
        episode = len(self._made) // experiment.batch
        self._offered = await self._planner.run(
            *(chosen_motion, self._task.name, self._held, observed.positions, observed.time_s, episode),
            *(tuple(self._made), hash((self._seed, self._draws)) % 2**31, self._site),
        )
        text = f"Push {len(self._made) + 1} of up to {experiment.budget}. {self._offered.text}."
        self._announcer.notice("experiment", text)
        return self._offered.motion

    async def put(self, transition: Transition, before: Particles, after: Particles, do: Callable[[str], None]) -> None:
        """A push was made. Where that completes a batch, weigh all causes by what was seen of all pushes."""
        experiment = self._experiment
        if experiment is None:
            return
        self._made.append(self._build_push(transition, before, after, experiment))
        if self._offered is not None:
            self._held, self._offered = self._offered.then, None
        count = len(self._made)
        if count % experiment.batch and count < experiment.budget:
            return
        do("weighing every cause")
        held = self._held = await self._planner.run(belief_after, self._task.name, tuple(self._made), experiment.budget)
        self._announcer.notice("experiment", held.text)
        if held.over:
            self._over, self._experiment = held.over, None
        elif self._opening is not None:
            opening = replace(self._opening, id=fresh_id("episode"), time_s=self._clock.now())
            self._announcer.say(opening)
            self._announcer.notice("experiment", "An episode ends; the object may be laid anew before the next push.")

    def _build_push(
        self, transition: Transition, before: Particles, after: Particles, experiment: Experiment
    ) -> "Push":
        from app.discovery.dataset.study import ProjectionView, Push

        executed = transition.executed

        def view(seen: Particles) -> ProjectionView:
            return ProjectionView(time_s=seen.time_s, points=seen.positions)

        moving = self._sensing.between(float(executed.times_s[0]), float(executed.times_s[-1]))
        return Push(
            episode=len(self._made) // experiment.batch,
            before=view(before),
            during=tuple(map(view, moving)),
            after=view(after),
            command=Track(times_s=executed.times_s, poses=executed.commanded),
            measured=Track(times_s=executed.times_s, poses=executed.measured) if len(executed.measured) else None,
        )


@final
class Asking:
    """Makes plans of the motions that the episode asks for, and of the pushes that `probing` chooses.

    Like any plan they are shown, approved and checked before the arm moves.
    """

    def __init__(
        self, config: EpisodeConfig, announcer: MessageBus, planner: Computer, site: Site, probing: Probing
    ) -> None:
        self._task, self._site = config.task.name, site
        self._announcer, self._planner = announcer, planner
        self._motions, self._probing = config.asked, probing
        self._offered, self._awaited = False, ""

    @property
    def is_due(self) -> bool:
        """True if a motion is still to be offered, or pushes are chosen."""
        return bool(self._motions) or self._probing.active

    def drop_offered(self) -> None:
        """The one that was offered, if any was, has been decided on, and is not offered again."""
        if self._offered:
            self._motions, self._offered = self._motions[1:], False

    async def plan(
        self,
        observed: Particles,
        goal: Points,
        model: Model,
        near: Centreline | None = None,
        orientation: Orientation = UNKNOWN,
        tool: ToolPose | None = None,
    ) -> "Plan | None":
        """The next motion, for the object and the tool as they are now.

        None where none is asked for, it does not fit here, or it cannot begin yet. Raises PlanningError where an
        experiment finds no push.
        """
        asked, x, self._offered = self._motions[:1], observed.positions, False
        motion = asked[0] if asked else await self._probing.motion(observed)
        if motion is None:
            return None
        try:
            found = await self._planner.run(
                *(plan_of_suggestion, self._task, x, goal, model, motion, self._site, near, orientation, tool)
            )
        except (PlanningError, WorkerError) as error:
            self._motions = self._motions[1:]
            self._announcer.notice("discovery", f"The motion that discovery asks for cannot be offered: {error}")
            return None
        if isinstance(found, str):
            self._wait_for(found)
            return None
        self._offered, self._awaited = True, ""
        self._announcer.notice("discovery", _about(motion, found.motion))
        return found

    def _wait_for(self, until: str) -> None:
        """Say, once, what has to be before the motion is offered; until then plans are made as usual."""
        if until != self._awaited:
            self._announcer.notice("discovery", f"The motion that discovery asks for is offered once {until}.")
        self._awaited = until


def _about(wanted: Motion, offered: Motion) -> str:
    axes = slice(3 if offered.continues else 2)
    apart_m = float(np.linalg.norm((offered.positions[0] - wanted.positions[0])[axes]))
    turned = 1 - abs(float(offered.poses[0, 3:7] @ wanted.poses[0, 3:7]))
    if apart_m < _MOVED_M and (turned < _TURNED or not offered.continues):
        return "Offered: the motion that discovery asks for, as it asks for it."
    if offered.continues:
        return (
            f"Offered: the motion that discovery asks for, begun {apart_m * 1e3:.0f} mm from where it was drawn, where "
            "the tool is now, and turned with it."
        )
    return (
        f"Offered: the motion that discovery asks for, moved by {apart_m * 1e3:.0f} mm to where the object lies now. "
        "Its direction, length and speed are as asked."
    )
