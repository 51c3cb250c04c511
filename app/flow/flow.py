"""The running application on one page: cameras -> particles -> model -> plan -> approval -> arm, and all begins again.

Every stage runs all the time, in one task group, joined by channels that say what they do when a reader is slow. What
is heavy runs in worker processes; STOP and jogging go from the console to the arm's process without passing here.
"""

from collections.abc import Generator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from typing import final

import anyio
from anyio.abc import TaskGroup

from app.config import Site
from app.core.announcer import MessageBus
from app.core.dialogue.approval import AUTOMATIC
from app.core.dialogue.checklist import ChecklistRequest
from app.core.dialogue.control import EndRequest, Lease, ModeRequest
from app.core.dialogue.requests import (
    CalibrationRequest,
    Chore,
    ClipRequest,
    ColourRequest,
    EditRequest,
    GoalRequest,
    ModelRequest,
    PictureGoalRequest,
    ProbeRequest,
    TakeRequest,
)
from app.core.dialogue.summary import Summary
from app.core.errors import DipacError, MotionRefused, first_error
from app.core.messages import (
    Decision,
    Executed,
    Message,
    Model,
    Notice,
    Particles,
    Proposal,
    ResumeRequest,
    StopRequest,
    Transition,
)
from app.core.ports import CameraShelf, Clock, Operator, Recorder, Rig, Studio
from app.core.rejection_codes import Refusal
from app.core.system.channel import ChannelFull, Lossless
from app.core.system.worker import Worker
from app.core.types import Points
from app.flow.approving import Approving
from app.flow.calibrating import Calibrating
from app.flow.demonstrating import Demonstrating
from app.flow.executing import Executing
from app.flow.goals import Aiming
from app.flow.model_monitor import ExecutedPush, Watching
from app.flow.model_updates import Learning
from app.flow.modes import Modes
from app.flow.perception_stage import Sensing
from app.flow.planning import Planning
from app.flow.preflight import Preflight
from app.flow.probing import Probing
from app.flow.reporting import Reporting
from app.flow.stop_latch import StopLatch
from app.flow.stopping import EXHAUSTED, StoppingRule
from app.flow.wait_until_still import rested
from app.tasks.elements.base import EpisodeConfig

_CHORES = 8
"""Bound of waiting requests; some hold pictures, and take seconds each."""
_LAST_CALIBRATION_S = 300.0
"""Timeout at the end of an episode for learning from its last pushes."""


@final
class Flow:
    """One episode. Build it, `await run()`, read the summary. `studio`, `shelf`: for demonstrations, calibrations."""

    def __init__(
        self,
        wish: EpisodeConfig,
        *,
        site: Site,
        rig: Rig,
        operator: Operator,
        recorder: Recorder,
        clock: Clock,
        planner: Worker,
        recording: Path | None = None,
        studio: Studio | None = None,
        shelf: CameraShelf | None = None,
    ) -> None:
        if wish.automatic and not rig.simulated:
            raise MotionRefused(Refusal.NOT_SIMULATED, "Automatic: on a simulated rig alone; use `dipac console`.")
        self.wish, self.site, self.rig = wish, site, rig
        self.operator, self.clock, self.summary, self.planner = operator, clock, Summary(), planner
        self.announcer = MessageBus(operator=operator, recorder=recorder, clock=clock, summary=self.summary)
        self.say, self.notice, self.fault = self.announcer.say, self.announcer.notice, self.announcer.fault
        how, by = wish.task.reconstruction(wish.preset), (self.announcer, clock)
        automatic = "freely" if rig.simulated else "confirmed" if wish.allow_automatic else "never"
        self.modes = Modes("automatic" if wish.automatic else "approve each", wish.pushes, *by, automatic=automatic)
        self.holding = StopLatch(rig, self.modes, *by, unattended=wish.automatic)
        self.sensing = Sensing(rig, how, self.summary, *by)
        self.learning = Learning(wish, planner, site, *by)
        self.probing = Probing(wish, planner, site, self.sensing, *by)
        self.planning, self.stopping = Planning(wish, planner, site, self.probing, *by), StoppingRule(wish, by[0])
        checked = wish.checklist or not rig.simulated
        self.preflight = Preflight(rig, site, self.sensing, self.holding, *by, needed=checked)
        self.approving = Approving(site, self.sensing, self.modes, *by, blocked=lambda: self.preflight.blocked_reason)
        self.executing = Executing(rig, self.holding, self.summary, *by)
        self.watching = Watching(*by, wish.verdict, recording)
        self.reporting = Reporting(site, rig, self.summary, *by)
        self.aiming = Aiming({each.model.name: each.model for each in rig.cameras}, self.sensing.perceiver, site, *by)
        self.demonstrating = Demonstrating(studio, *by)
        self.calibrating = Calibrating(rig, self.sensing.frames, shelf, site, *by)
        self.chores = Lossless[Chore]("chores", bound=_CHORES)
        self._attempts, self._begun_with, self._acts = 0, 0, False
        self._observed: Particles | None = None
        self._touched_s = clock.now()

    async def run(self) -> Summary:
        """Push until the goal is reached or the pushes are used up; if `staying`, until an operator ends it.

        Raises the first DipacError of any stage.
        """
        async with self.announcer.recording(), self.sensing.perceiver, self.planner, self.learning.calibrator:
            try:
                async with anyio.create_task_group() as stages:
                    for part in (self.sensing, self.learning, self.watching, self.calibrating, self.preflight):
                        stages.start_soon(part.run)
                    stages.start_soon(self._listen)
                    stages.start_soon(self.reporting.run, self.sensing, self.learning, self.approving, self.modes)
                    self.say(self.wish.goal)
                    self.modes.begin()
                    await self._work(stages)
                    stages.cancel_scope.cancel()
            except BaseExceptionGroup as group:
                error = first_error(group)
                self.announcer.end(error)
                raise error from group
        return self.summary

    async def _listen(self) -> None:
        """The operator's requests. The arm has stopped before a StopRequest gets here."""
        async for request in self.operator.requests():
            await self.announcer.room()  # However fast somebody asks, the log keeps up.
            self.say(request)
            match request:
                case Decision():
                    self.approving.hear(request)
                case StopRequest():
                    self.holding.pressed(request)
                case ResumeRequest():
                    await self.holding.resume(request)
                case ModeRequest():
                    self._begun_with = self.summary.pushes
                    self.modes.asked(request)
                case EndRequest():
                    self.modes.end()
                case Lease():
                    self.modes.on_control_transfer(request)
                    self.preflight.on_control_transfer(request)
                case ChecklistRequest():
                    await self.preflight.asked(request)
                case Notice():
                    pass  # Saying it is all.
                case _:
                    self._put(request)

    def _put(self, chore: Chore) -> None:
        """Queue a chore; other requests never wait for it."""
        try:
            self.chores.put_nowait(chore)
        except ChannelFull:
            self.notice("console", "Too much was asked for at once; wait for what is being done.", chore.id)

    async def _attend(self) -> None:
        """Handle requests that take a while, one after the other."""
        async for chore in self.chores:
            match chore:
                case GoalRequest() | PictureGoalRequest():
                    await self._aim(chore)
                case TakeRequest():
                    await self._demonstrate(chore)
                case ClipRequest():
                    await self.demonstrating.clip(chore)
                case EditRequest():
                    await self._edit(chore)
                case ModelRequest():
                    await self._use(chore)
                case ProbeRequest():
                    self.probing.asked(chore, self.modes.interrupt)
                case ColourRequest():
                    self.sensing.recolour(chore)
                case CalibrationRequest():
                    await self.calibrating.asked(chore, self.modes.name)

    async def _aim(self, request: GoalRequest | PictureGoalRequest) -> None:
        if wish := await self.aiming.aimed(self.wish, request, self.sensing.seeing.how, self.learning.models.value):
            self.wish = wish
            self.planning.forget()
            self.modes.interrupt("is for another goal")

    async def _edit(self, request: EditRequest) -> None:
        """Simulate a change of the plan that is shown, which stays up until then, and propose it instead."""
        seen, shown = self.sensing.particles.value, self.approving.asked
        changed = await self.planning.changed(self.wish, request, shown, seen, self._model) if seen else None
        if changed is not None and self.approving.asked is shown:
            self.modes.interrupt("is offered as you changed it")
            self.planning.offer_next(changed, self.modes.interruptions)

    async def _use(self, request: ModelRequest) -> None:
        """Plan with another model, and with the goal as its cameras observe it."""
        if used := await self.learning.use(request, self.wish.goal.positions):
            self.wish = replace(self.wish, shown_goal=used[1])
            self.planning.forget()
            self.modes.interrupt("is of another model")

    async def _demonstrate(self, request: TakeRequest) -> None:
        """Begin or end a demonstration; a motion that is being made belongs to what there is, once it was seen."""
        if request.act != "discard":
            await rested(self.rig.arm, self.site.timing, self.clock, acts=lambda: self._acts)
        await self.demonstrating.asked(request, self._known)

    def _known(self) -> list[Message]:
        """Messages at the beginning of a recording that make it complete by itself."""
        frames = [channel.value for channel in self.sensing.frames.values()]
        known = (self.wish.goal, self.modes.now, self.learning.models.value, *frames, self.sensing.particles.value)
        return [message for message in known if message is not None]

    async def _work(self, stages: TaskGroup) -> None:
        """See, plan, ask, act, learn; and again. What of it is done depends on the mode."""
        self.learning.begin(model := await self.planning.begin(self.wish, self.reporting.do))
        stages.start_soon(self._attend)
        stages.start_soon(self.planning.warm_up, self.wish, model)
        while not self.modes.ended:
            try:
                await self._turn()
            except DipacError as error:
                if not self.wish.staying:
                    raise
                self.fault("application", error)
                self.modes.set("idle", "something failed; see the messages, then choose a mode")
        self.reporting.do("finishing the calibration")
        with self.clock.move_on_after(_LAST_CALIBRATION_S):
            while self.learning.done < self.learning.submitted or self.watching.seen < self.watching.submitted:
                await self.clock.sleep(self.site.timing.health_period_s)
        self.reporting.do("done")

    async def _turn(self) -> None:
        match self.modes.name:
            case "idle":
                self.reporting.do("idle")
                await self.modes.over.wait()
            case "teleoperate":
                await self._moved_by_hand()
            case "plan only" | "approve each" | "automatic":
                await self._planned()

    async def _planned(self) -> None:
        """A plan, and its motion where it is approved."""
        asked, observed = self.modes.interruptions, None
        with self.modes.lasting():
            await self.planning.warm(self.reporting.do)
            if self.modes.name == "automatic":
                await self.preflight.wait(self.reporting.do)
            await self.holding.resumed(self.reporting.do)
            observed = self._observed or await self._look()
        if observed is None or self.modes.interruptions != asked or self._is_enough(observed):
            return
        self.reporting.do("planning")
        model, tool, seeds = self._model, self.rig.arm.tool(), (self.wish.seed, self.summary.pushes, self._attempts)
        proposal = await self.planning.proposal(self.wish, observed, model, tool, seeds, at=asked)
        self._attempts += 1
        self._touched()
        if self.modes.interruptions != asked:
            self.notice("plan", f"{proposal.id} {self.modes.interrupted}.", proposal.id)
        elif not self.approving.moved_away(proposal):
            if self.modes.name != "automatic" or self.stopping.admits(proposal, self.wish.target):
                await self._shown(proposal)
            elif self.stopping.exhausted:
                self.summary.exhausted = True
                self._leave_off(EXHAUSTED)

    async def _shown(self, proposal: Proposal) -> None:
        """Show it and, where that is the mode, make its motion once it is approved."""
        if self.modes.name == "plan only":
            self.reporting.do("showing a plan")
            await self.approving.preview(proposal)
            self._touched()
            return
        self.reporting.do("waiting for approval")
        target = self.wish.target
        decision, approved = await self.approving.decided(proposal)
        if decision is not None and (approved or not decision.approve):
            self.planning.decided(proposal, approved=approved is not None)
        self._touched()
        if approved is None:
            return
        before = self.sensing.particles.value  # what the approval was checked against, maybe minutes after the plan
        with self._acting():
            executed = await self.executing.execute(approved, self.reporting.do) if not self.modes.ended else None
            self._touched()
            if before and executed and executed.outcome == "completed":
                self._observed = await self._look()
                self.planning.keep_prediction(proposal)
                await self._learn(proposal, before, executed, self._observed, target)
        if executed and approved.operator == AUTOMATIC:
            self.modes.moved()

    async def _moved_by_hand(self) -> None:
        """Record the operator's jogging, from rest to rest, and learn from it like from any motion."""
        with self.modes.lasting() as lasting:
            await self.preflight.wait_by_hand(self.reporting.do)
            await self.holding.resumed(self.reporting.do)
        if lasting.cancel_called:
            return
        self.reporting.do("waiting to be moved by hand")
        try:
            executed = await self.rig.arm.jogged(self.modes.over)
        except MotionRefused as refusal:
            self.holding.hold(str(refusal))
            return
        self._touched()
        if executed is not None:
            with self._acting():
                await self._learn_by_hand(self.say(executed))

    async def _learn_by_hand(self, executed: Executed) -> None:
        self.planning.discard_prediction()
        self.holding.heed(executed)
        before = self.sensing.before(executed.times_s[0])
        # Before the checklist is passed nobody knows where cameras stand, and what they show teaches nothing.
        known = self.wish.answering and self.preflight.passed
        if known and before and executed.outcome == "completed":
            self.reporting.do("looking at what was done by hand")
            after = self._observed = await self._look()
            transition = self.say(Transition.between(before, executed, after, time_s=self.clock.now()))
            self.demonstrating.learned(transition)
            self.planning.note_transition(transition, self._model)
            await self.learning.put(transition)

    @contextmanager
    def _acting(self) -> Generator[None]:
        """Mark the time of a motion and of the observation of its outcome."""
        self._acts = True
        try:
            yield
        finally:
            self._acts = False

    async def _look(self) -> Particles:
        """The first particles whose every frame was taken with the arm at rest, `settle_s` after it moved last."""
        self.reporting.do("looking at the object")
        due_s = max(self._touched_s, self.holding.resumed_s) + self.site.timing.settle_s
        observed = await self.sensing.settled(due_s=due_s)
        self.summary.saw(observed, self.wish.target)
        return observed

    def _is_enough(self, observed: Particles) -> bool:
        """True if nothing is left to plan for: the goal is reached, or the motions are made."""
        reached = self.summary.reached = self.wish.reached(observed, self.rig.arm.tool()) and not self.probing.active
        made = self.summary.pushes - self._begun_with
        counted = self.wish.staying and self.modes.name == "automatic"  # The mode itself counts these.
        over = self.probing.conclusion()
        if not reached and not over and (counted or self.probing.active or made < self.wish.pushes):
            return False
        self._leave_off(over or ("the goal is reached" if reached else f"{made} motions were made"))
        return True

    def _leave_off(self, why: str) -> None:
        if self.wish.staying:
            self.modes.set("idle", f"{why}; set another goal or choose a mode")
        else:
            self.modes.end()

    async def _learn(
        self, proposal: Proposal, before: Particles, executed: Executed, after: Particles, goal: Points
    ) -> None:
        """Score the push towards the goal that it was planned for; hand on the transition, where there can be one."""
        self.say(self.summary.scored(proposal, before, executed, after, goal, now_s=self.clock.now()))
        if not self.wish.answering:
            return
        transition = self.say(Transition.between(before, executed, after, time_s=self.clock.now()))
        self.demonstrating.learned(transition)
        self.planning.note_transition(transition, self._model)
        await self.watching.put(ExecutedPush(proposal, transition, self.learning.models.value))
        await self.probing.put(transition, before, after, self.reporting.do)
        await self.learning.put(transition)

    def _touched(self) -> None:
        """Invalidate all observations so far: something may have moved."""
        self._observed, self._touched_s = None, self.clock.now()

    @property
    def _model(self) -> Model:
        model = self.learning.models.value
        assert model is not None, "warming up has said one"
        return model
