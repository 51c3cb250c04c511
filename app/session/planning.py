"""The planner's process: warmed up, asked for plans, and asked again where it fails."""

from collections import deque
from collections.abc import Callable
from typing import TYPE_CHECKING, final

import anyio
import numpy as np
from jaxtyping import Float32

from app.arm.path import SCALE, route
from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue import words
from app.core.dialogue.requests import EditRequest
from app.core.errors import DipacError, PlanningError, WorkerError
from app.core.geometry.orientation import UNKNOWN, Orientation
from app.core.messages import MessageId, Model, Particles, Proposal, Transition
from app.core.ports import Clock, Computer
from app.core.system.channel import Latest
from app.core.types import Centreline, Points, ToolPose
from app.jobs.edited import edited_plan
from app.jobs.worker_api import (
    RECENT,
    doubt,
    nominal_model,
    plan,
    track_orientation,
    true_positions,
    uncalibrated_model,
    warm_up_stage,
    warm_up_stages,
)
from app.planner.search.request import Ahead, remainder_of
from app.session.suggested_motions import Asking, Probing
from app.tasks.elements.base import EpisodeConfig

if TYPE_CHECKING:  # The planner is loaded in its own process alone.
    from app.planner.search.plan import Plan

FAILURES_IN_A_ROW = 3
_NOTHING = ""


@final
class Planning:
    """Maker of proposals. Requested pushes take precedence over the planner's."""

    def __init__(
        self,
        config: EpisodeConfig,
        planner: Computer,
        site: Site,
        probing: Probing,
        announcer: MessageBus,
        clock: Clock,
    ) -> None:
        self._announcer, self._clock = announcer, clock
        self._planner, self._site = planner, site
        self._asking = Asking(config, announcer, planner, site, probing)
        self.ahead = PlanningAhead(planner, announcer)
        self._compiling = Latest[str]("compiling")
        self._changed: tuple[int, Proposal] | None = None
        self._doubted = ""
        self._rejected: tuple[Float32[np.ndarray, "_ 3"], ...] = ()
        self._predicted: dict[MessageId, Centreline] = {}
        self._near: Centreline | None = None
        self._approved: Proposal | None = None
        self._last: Proposal | None = None
        self._orientation = UNKNOWN
        self._seen = deque[tuple[Transition, Model]](maxlen=RECENT)
        self._plan_s = np.inf

    async def begin(self, config: EpisodeConfig, do: Callable[[str], None]) -> Model:
        """Start the planner's process, reported to `do`, and return the initial model."""
        do("starting the planner")
        known = nominal_model if config.method.calibrated else uncalibrated_model
        return config.model or await self._planner.run(known, config.task.name)

    async def warm_up(self, config: EpisodeConfig, model: Model) -> None:
        """Compile what planning needs. Whoever moves the tool by hand need not wait for it."""
        planner, task, preset, method = self._planner, config.task.name, config.preset, config.method
        for index, stage in enumerate(await planner.run(warm_up_stages, task, preset, model, method, self._site)):
            self._compiling.put(stage)
            await planner.run(warm_up_stage, task, preset, index, model, method, self._site)
        self._compiling.put(_NOTHING)

    async def warm(self, do: Callable[[str], None]) -> None:
        """Wait until all is compiled; `do` reports each stage."""
        async for stage in self._compiling.changes():
            if stage == _NOTHING:
                return
            do(f"compiling {stage}")

    def on_decision(self, proposal: Proposal, *, approved: bool) -> None:
        """React to a decision. A rejected plan is not proposed again before something has moved."""
        self._asking.drop_offered()
        self._rejected = () if approved else (*self._rejected, proposal.chosen.tool_path)
        self._last, self._approved = None, proposal if approved else None
        if approved:
            self._near = None

    def keep_prediction(self, proposal: Proposal) -> None:
        """Keep the prediction for the next plan: the motion was made, and the object lies about as predicted.

        Where it truly does, the next plan starts from what is left of this one, too, unless plans were forgotten while
        the motion was made.
        """
        self._near = self._predicted.get(proposal.id)
        self._last, self._approved = self._approved, None

    def note_transition(self, transition: Transition, model: Model) -> None:
        """Note a motion that was seen, by which the next plan follows the object's ends."""
        self._seen.append((transition, model))

    def discard_prediction(self) -> None:
        """Forget the prediction, and rejected or changed plans: the object lies elsewhere."""
        self._near = None
        self.forget()

    def forget(self) -> None:
        """Forget rejected, changed and earlier plans: the object may have moved, or the goal is another."""
        self._rejected, self._changed, self._last, self._approved = (), None, None, None

    async def edit(
        self, config: EpisodeConfig, request: EditRequest, shown: Proposal, observed: Particles, model: Model
    ) -> Proposal | None:
        """The plan that is shown with the requested change; None if it is infeasible, which is announced."""
        began_s, goal = self._clock.now(), config.goal.positions
        index = shown.best if request.branch < 0 else request.branch
        try:
            found = await self._planner.run(
                *(edited_plan, config.task.name, config.preset, observed.positions, goal, model, shown.branches, index),
                *(request.start, request.end, self._site, self._near, self._orientation),
            )
        except (PlanningError, WorkerError) as error:
            self._announcer.notice("edit", f"The edited motion cannot be offered. {error}")
            return None
        return self._propose(config, found, observed, model, (began_s, self._clock.now()))

    def look_ahead(
        self, config: EpisodeConfig, proposal: Proposal, model: Model, tool: ToolPose, seed: int, *, at: int
    ) -> None:
        """Plan for where the object is predicted to lie once the arm has made this motion from `tool`.

        Only where the motion and the rest after it last as long as a decision of late: whoever finds the prediction
        wrong then waits no longer for a plan than without it. During the first motion what this takes is compiled.
        `at`: as for `proposal`.
        """
        way, speeds = route(tool, proposal.motion, self._site)
        settle_s = max(self._site.timing.settle_s, config.task.stage.settle_s)
        lasts_s = float((np.linalg.norm(np.diff(way * SCALE, axis=0), axis=1) / speeds).sum()) + settle_s
        now, then = proposal.observed, proposal.chosen.predicted
        if self._asking.is_due or config.method.alone or config.task.has_ended(then, config.goal.positions, way[-1]):
            return

        def arguments(x: Points, tool: ToolPose) -> tuple[object, ...]:
            where = config.task.name, config.preset, x, config.goal.positions, model, seed, self._site, tool
            return (*where, config.method, (), self._predicted.get(proposal.id), self._orientation)

        if not self.ahead.compiled:
            made = Ahead(predicted=now, branches=proposal.branches, best=proposal.best)
            if made.promise_m2 > 0.0:
                self.ahead.compile((*arguments(now, tool), None, made))
        elif self._plan_s <= lasts_s:
            self.ahead.begin((*arguments(then, way[-1]), remainder_of(proposal.chosen, now, then)), then, at=at)

    def offer_next(self, changed: Proposal, at: int) -> None:
        """Propose it before the next plan, unless plans have become void since `at` (`SessionState.interruptions`)."""
        self._changed = at, changed

    async def proposal(
        self,
        config: EpisodeConfig,
        observed: Particles,
        model: Model,
        tool: ToolPose,
        seeds: tuple[int, ...],
        *,
        at: int,
    ) -> Proposal:
        """A plan; where the planner fails, another with other random branches. The third error in a row is raised.

        What the operator made of a plan goes before what discovery asks for, and both before the planner's own; unless
        plans have become void since: `at` is how often they had (`SessionState.interruptions`).
        """
        changed, self._changed = self._changed, None
        if changed is not None and changed[0] == at:
            return self._announcer.say(changed[1])
        self._predicted.clear()
        started_s, x, goal = self._clock.now(), observed.positions, config.goal.positions
        ahead = await self.ahead.take(at=at)
        await self._track(config)
        lies = self._near, self._orientation
        remainder = None if self._last is None else remainder_of(self._last.chosen, self._last.observed, x)
        for attempt in range(FAILURES_IN_A_ROW):
            seed, begun_s = hash((*seeds, attempt)) % 2**31, self._clock.now()
            try:
                asked = await self._asking.plan(observed, goal, model, *lies, tool)
                found = asked or await self._planner.run(
                    *(plan, config.task.name, config.preset, x, goal, model, seed, self._site, tool, config.method),
                    *(self._rejected, *lies, remainder, None if attempt else ahead),
                )
                if asked is None and not found.ahead:
                    self._plan_s = self._clock.now() - begun_s
            except (PlanningError, WorkerError) as error:
                self._announcer.fault("planner", error)
                if attempt + 1 == FAILURES_IN_A_ROW:
                    raise
            else:
                await self._doubt(config, x)
                now_s = self._clock.now()
                return self._announcer.say(self._propose(config, found, observed, model, (started_s, now_s)))
        raise AssertionError("the last attempt returns or raises")

    def _propose(
        self, config: EpisodeConfig, found: "Plan", observed: Particles, model: Model, lasted_s: tuple[float, float]
    ) -> Proposal:
        """A plan made from one time to another, whose prediction helps to find the rope once it is carried out."""
        proposal = config.proposal(found, observed, model, began_s=lasted_s[0], now_s=lasted_s[1])
        self._predicted[proposal.id] = found.centreline
        return proposal

    async def _track(self, config: EpisodeConfig) -> None:
        """Follow the object's ends through what was seen, and say it where they become known."""
        while self._seen:
            transition, model = self._seen.popleft()
            before = self._orientation
            try:
                self._orientation = await self._planner.run(
                    track_orientation, config.task.name, before, transition, model
                )
            except DipacError as error:
                self._announcer.fault("orientation", error)
            if self._orientation.is_known and not before.is_known:
                self._announcer.notice("orientation", _orientation_text(self._orientation), transition.id)

    async def _doubt(self, config: EpisodeConfig, x: Points) -> None:
        """Say, once, what makes it doubtful that the simulation begins where the object is."""
        said = await self._planner.run(doubt, config.task.name, x, self._near)
        if said and said != self._doubted:
            self._announcer.notice("planner", f"{said} Until then what is predicted may be wrong.")
        self._doubted = said


@final
class _Order:
    """One plan to be made: arguments of `app.jobs.worker_api.plan`, and what was `found` once it is `done`.

    `predicted`: the particles among them (N, 3) [m]; None where what is found does not matter. `at`: how often plans
    had become void when it was ordered (`SessionState.interruptions`).
    """

    def __init__(self, arguments: tuple[object, ...], predicted: Points | None = None, at: int = 0) -> None:
        self.arguments, self.predicted, self.at = arguments, predicted, at
        self.found: Ahead | None = None
        self.done = anyio.Event()


@final
class PlanningAhead:
    """Plans for where the object is predicted to lie after the motion that is being made: one at a time.

    `begun`: how many have been ordered; `compiled`: what simulates them again is, or is being.
    """

    def __init__(self, planner: Computer, announcer: MessageBus) -> None:
        self._planner, self._announcer = planner, announcer
        self._orders = Latest[_Order]("plans ahead")
        self._pending: _Order | None = None
        self.compiled, self.begun = False, 0

    def compile(self, arguments: tuple[object, ...]) -> None:
        """Compile what simulates a plan again, by these arguments of `app.jobs.worker_api.plan`, one made ahead."""
        self.compiled = True
        self._orders.put(_Order(arguments))

    def begin(self, arguments: tuple[object, ...], predicted: Points, *, at: int) -> None:
        """Plan with these arguments of `app.jobs.worker_api.plan`, instead of what was ordered before."""
        self._pending, self.begun = _Order(arguments, predicted, at), self.begun + 1
        self._orders.put(self._pending)

    def drop(self) -> None:
        """Make no use of what was ordered: the motion was not made."""
        self._pending = None

    async def run(self) -> None:
        """Orders -> plans, for ever. Without one the next decision plans anew, and says what is wrong with plans."""
        async for order in self._orders.changes():
            try:
                order.found = await self._made(order)
            except PlanningError:
                pass
            except DipacError as error:
                self._announcer.fault("planner", error)
            finally:
                order.done.set()

    async def _made(self, order: _Order) -> Ahead | None:
        found = await self._planner.run(plan, *order.arguments)
        if order.predicted is None:
            return None
        made = Ahead(predicted=order.predicted, branches=found.branches, best=found.best)
        return made if made.promise_m2 > 0.0 else None

    async def take(self, *, at: int) -> Ahead | None:
        """The plan, once it is made; None where none was ordered, or plans have become void since."""
        order, self._pending = self._pending, None
        if order is None or order.at != at:
            return None
        await order.done.wait()
        return order.found


def _orientation_text(orientation: Orientation) -> str:
    return (
        f"Which end of the object is the model's first one is known now, with a probability of "
        f"{words.probability(orientation.probability)}: plans heed all effects along it."
    )


async def is_reached(
    planner: Computer, config: EpisodeConfig, observed: Particles, model: Model, tool: ToolPose
) -> bool:
    """True if the task is done, as far as the model knows where the object truly is that cameras see.

    False where the planner's process cannot tell, which the next plan then reports.
    """
    if not model.apparatus:
        return config.is_reached(observed, tool)
    try:
        x = await planner.run(true_positions, observed.positions, model, tool)
    except WorkerError:
        return False
    return config.task.has_ended(x, config.goal.positions, tool)
