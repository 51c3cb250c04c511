"""Stages of a session's loop, and motions by hand, which are seen and learned from beside it."""

from typing import Final, NamedTuple, final

from app.core.dialogue.approval import AUTOMATIC, Approved
from app.core.dialogue.requests import is_requested
from app.core.errors import MotionRefused
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Executed, MessageId, Particles, Proposal, Transition
from app.core.types import Points
from app.session.loop import go_round
from app.session.model_monitor import ExecutedPush
from app.session.parts import Parts
from app.session.planning import FAILURES_IN_A_ROW, is_reached
from app.session.state import (
    HandRefusal,
    MotionEnd,
    Observation,
    PlanAssessment,
    RequestedEnd,
    RequestedMotions,
    UnaskedMotion,
)

_GAIN: Final = 0.05
"""Share of the Chamfer distance by which a branch has to bring the object nearer where it costs more than no motion:
what contact costs is there to find the object, and no reason to leave off."""


@final
class Leave(NamedTuple):
    """Approved motion of a plan towards `target` (M, 3) [m], and the particles that the approval was checked against.

    These may be minutes younger than the plan.
    """

    proposal: Proposal
    approved: Approved
    before: Particles | None
    target: Points


@final
class ExecutedPlan(NamedTuple):
    """Motion of a plan as it was made, to its end or not."""

    leave: Leave
    executed: Executed


@final
class SessionStages:
    """`acts`: a motion is being made, or what came of it is being looked at."""

    def __init__(self, parts: Parts) -> None:
        self._parts, self._store = parts, parts.store
        self.acts = False
        self._began_s = self._touched_s = parts.clock.now()
        self._attempts = self._refused = 0
        self._moved_s = self._began_s
        self._due = MessageId("")
        self._observed: Particles | None = None

    async def observe(self) -> Particles | None:
        """The object as it lies now; None where plans are void meanwhile, or nothing is left to plan for."""
        parts, do, asked = self._parts, self._parts.reporting.do, self._store.state.interruptions
        with self._store.in_this_mode():
            await parts.planning.warm(do)
            if self._store.state.mode == "automatic":
                await parts.preflight.wait(do)
            await parts.latch.wait(do)
            observed = self._observed or await self._look()
        if self._store.state.interruptions != asked:  # As they are with the mode.
            return None
        if self._store.state.requested is not None:  # Whether the goal is reached does not matter to it.
            return observed
        config, tool, model = self._store.state.config, parts.rig.arm.tool(), self._store.state.model_in_use
        reached = await is_reached(parts.planner, config, observed, model, tool)
        if self._store.state.interruptions != asked:
            return None
        summary, active = parts.summary, parts.probing.active
        summary.reached = reached and not active
        seen = Observation(summary.reached, summary.pushes, active, parts.probing.conclusion())
        return observed if self._store.dispatch(seen).interruptions == asked else None

    async def plan(self, observed: Particles) -> Proposal | None:
        """A plan for the object where it is, which has been published; None where it is void or not worth its while."""
        parts, state = self._parts, self._store.state
        parts.reporting.do("planning")
        config, asked = state.config, state.interruptions
        if state.requested is not None:
            return await self._requested(state.requested, observed)
        seeds = (config.seed, parts.summary.pushes, self._attempts)
        tool = parts.rig.arm.tool()
        proposal = await parts.planning.proposal(config, observed, state.model_in_use, tool, seeds, at=asked)
        self._attempts += 1
        self._invalidate_observations()
        if (state := self._store.state).interruptions != asked:
            parts.announcer.notice("plan", f"{proposal.id} {state.interrupted}.", proposal.id)
            return None
        if parts.approving.moved_away(proposal):
            return None
        return proposal if state.mode != "automatic" or self._is_worth_making(proposal) else None

    async def approve(self, plan: Proposal) -> Leave | None:
        """Leave to make the motion, where that is the mode and it is approved."""
        parts, state = self._parts, self._store.state
        if state.mode == "plan only":
            parts.reporting.do("showing a plan")
            await parts.approving.preview(plan)
            self._invalidate_observations()
            return None
        parts.reporting.do("waiting for approval")
        target = state.config.target
        decision, approved = await parts.approving.wait_for_decision(plan)
        if decision is not None and (approved or not decision.approve):
            if not is_requested(plan):
                parts.planning.on_decision(plan, approved=approved is not None)
            elif approved is None:
                self._store.dispatch(RequestedEnd(made=False, asked=self._due))
        self._invalidate_observations()
        return None if approved is None else Leave(plan, approved, parts.sensing.particles.value, target)

    async def execute(self, leave: Leave) -> ExecutedPlan | None:
        """The motion that the arm made, to its end or not; None where a stop is in force, or the arm refused it.

        Raises the arm's MotionRefused when it has refused several motions in a row: the next would fare no better.
        """
        self.acts = True
        self._look_ahead(leave.proposal)
        executed = await self._execute(leave.approved) if not self._store.state.ended else None
        if executed is None:
            self._parts.planning.ahead.drop()
        self._invalidate_observations()
        self._moved_s = self._touched_s
        if is_requested(leave.proposal) and (executed is None or executed.outcome != "completed"):
            self._store.dispatch(RequestedEnd(made=False, asked=self._due))
        return None if executed is None else ExecutedPlan(leave, executed)

    async def learn(self, made: ExecutedPlan) -> None:
        """Look at what came of it; score it, and learn from it where it was made to its end."""
        (proposal, approved, before, target), executed = made
        parts = self._parts
        if is_requested(proposal):
            await self._learn_of_requested(made)
            return
        if before and executed.outcome == "completed":
            after = self._observed = await self._look()
            parts.planning.keep_prediction(proposal)
            now_s = parts.clock.now()
            parts.announcer.say(parts.summary.score(proposal, before, executed, after, target, now_s=now_s))
            if self._store.state.config.answering:
                transition, model = self._note_transition(before, executed, after), self._store.state.model
                await parts.watching.put(ExecutedPush(proposal, transition, model))
                await parts.probing.put(transition, before, after, parts.reporting.do)
                await parts.learning.put(transition)
        if approved.operator == AUTOMATIC:
            self._store.dispatch(UnaskedMotion())

    def _look_ahead(self, proposal: Proposal) -> None:
        """Plan the next motion while this one is made, unless it is the last or somebody asked for it."""
        parts, state = self._parts, self._store.state
        config, made = state.config, parts.summary.pushes + 1
        counted = config.staying and state.mode == "automatic"
        is_last = state.motions <= 1 if counted and state.holder else made - state.pushes_before >= config.pushes
        if is_last or is_requested(proposal) or state.stopped or state.ended:
            return
        seed, tool = hash((config.seed, made, self._attempts)) % 2**31, parts.rig.arm.tool()
        parts.planning.look_ahead(config, proposal, state.model_in_use, tool, seed, at=state.interruptions)

    async def _requested(self, requested: RequestedMotions, observed: Particles) -> Proposal | None:
        """The motion that was asked for, as a plan; what was asked for ends where it fits no more."""
        parts, state = self._parts, self._store.state
        self._due = requested.asked
        proposal = await parts.requested_motions.proposal(requested, state.config, observed, state.model_in_use)
        self._invalidate_observations()
        if self._store.state.interruptions != state.interruptions:
            if proposal is not None:
                parts.announcer.notice("plan", f"{proposal.id} {self._store.state.interrupted}.", proposal.id)
            return None
        if proposal is None:
            self._store.dispatch(RequestedEnd(made=False, asked=self._due))
            return None
        return None if parts.approving.moved_away(proposal) else proposal

    async def _learn_of_requested(self, made: ExecutedPlan) -> None:
        """Learn from a motion of a demonstration as from one by hand: it is not scored."""
        (proposal, _, before, _), executed = made
        parts = self._parts
        if executed.outcome != "completed":
            return
        if proposal.chosen.origin == "shown":
            parts.planning.discard_prediction()
            after = self._observed = await self._look()
            if before and self._store.state.config.answering:
                transition, model = self._note_transition(before, executed, after), self._store.state.model
                await parts.watching.put(ExecutedPush(proposal, transition, model))
                await parts.learning.put(transition)
        self._store.dispatch(RequestedEnd(made=True, asked=self._due))

    async def turn(self) -> None:
        """One turn of the mode; whatever ends it, nothing is made any more."""
        try:
            match self._store.state.mode:
                case "idle":
                    self._parts.reporting.do("idle")
                    await self._store.mode_over.wait()
                case "teleoperate":
                    await self._by_hand()
                case "plan only" | "approve each" | "automatic":
                    await go_round(self)
        finally:
            self.acts = False

    async def _by_hand(self) -> None:
        """Record the operator's jogging, from rest to rest, and learn from it like from any motion."""
        parts = self._parts
        await parts.latch.hand_over()
        with self._store.in_this_mode() as lasting:
            await parts.preflight.wait_by_hand(parts.reporting.do)
            await parts.latch.wait(parts.reporting.do)
        if lasting.cancel_called:
            return
        parts.reporting.do("waiting to be moved by hand")
        try:
            executed = await parts.rig.arm.accept_jogs(self._store.mode_over)
        except MotionRefused as refusal:
            self._store.dispatch(HandRefusal(str(refusal)))
            return
        self._invalidate_observations()
        if executed is not None:
            self.acts = True
            await self._learn_by_hand(parts.announcer.say(executed))

    async def _learn_by_hand(self, executed: Executed) -> None:
        parts = self._parts
        parts.planning.discard_prediction()
        self._store.dispatch(MotionEnd(executed, parts.rig.arm.held))
        before, moved_s, self._moved_s = parts.sensing.before(executed.times_s[0]), self._moved_s, self._touched_s
        # Before the checklist is passed nobody knows where cameras stand, and what they show teaches nothing; nor does
        # what was seen while something else still moved the object.
        known = self._store.state.config.answering and self._store.state.passed
        if known and before and before.time_s >= moved_s and executed.outcome == "completed":
            parts.reporting.do("looking at what was done by hand")
            self._observed = await self._look()
            await parts.learning.put(self._note_transition(before, executed, self._observed))

    def _note_transition(self, before: Particles, executed: Executed, after: Particles) -> Transition:
        """Publish the transition, and note it where it counts at once."""
        parts = self._parts
        transition = parts.announcer.say(Transition.between(before, executed, after, time_s=parts.clock.now()))
        parts.demonstrating.count(transition)
        parts.planning.note_transition(transition, self._store.state.model_in_use)
        return transition

    async def _look(self) -> Particles:
        """The first particles whose every frame was taken with arm and object at rest: some time after it moved."""
        parts = self._parts
        parts.reporting.do("looking at the object")
        settle_s = max(parts.site.timing.settle_s, self._store.state.config.task.stage.settle_s)
        due_s = max(self._touched_s, self._store.state.resumed_s) + settle_s
        observed = await parts.sensing.next_particles(due_s=due_s)
        parts.summary.saw(observed, self._store.state.config.target)
        return observed

    def _invalidate_observations(self) -> None:
        """Invalidate all observations so far: something may have moved."""
        self._observed, self._touched_s = None, self._parts.clock.now()

    def _is_worth_making(self, proposal: Proposal) -> bool:
        """True if it is better than no motion, by the model.

        Asked only where each motion of the task ends at rest: of a longer sequence, what it costs so far says nothing.
        A policy that acts without a planner is not weighed.
        """
        config = self._store.state.config
        weighs = config.task.at_rest and not config.method.alone
        worth = not weighs or proposal.is_improvement or brings_nearer(proposal, config.target)
        if self._store.dispatch(PlanAssessment(proposal, worth)).is_exhausted:
            self._parts.summary.exhausted = True
        return worth

    async def _execute(self, approved: Approved) -> Executed | None:
        parts = self._parts
        if self._store.state.stopped:
            return None
        parts.reporting.do("pushing")
        try:
            executed = await parts.rig.arm.execute(approved)
        except MotionRefused as refusal:
            parts.announcer.fault("arm", refusal)
            self._refused += 1
            if self._refused >= FAILURES_IN_A_ROW:
                self._refused = 0
                raise
            return None
        self._refused = 0
        parts.summary.began_moving(executed.times_s[0] - self._began_s)
        self._store.dispatch(MotionEnd(executed, parts.rig.arm.held))
        return parts.announcer.say(executed)


def brings_nearer(proposal: Proposal, goal: Points) -> bool:
    """True where all actions of the branch that is followed bring the object nearer by a share that counts.

    By the distance of its task too, where the plan says so: against a wall, the Chamfer distance is no way.
    """
    before, after = chamfer_m2(proposal.observed, goal), chamfer_m2(proposal.chosen.final, goal)
    return bool(after < (1 - _GAIN) * before and proposal.chosen.terms.get("progress", after - before) < 0)
