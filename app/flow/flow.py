"""The running application on one page: cameras -> particles -> model -> plan -> approval -> arm, and all begins again.

Every stage runs all the time, in one task group, joined by channels that say what they do when a reader is slow. What
is heavy runs in worker processes; STOP goes from the console to the arm's process without passing through here.
"""

from pathlib import Path
from typing import final

import anyio
from anyio import to_thread

from app.config import Site
from app.core.announcer import Announcer
from app.core.approval import ApprovalGate, Approved, automatic_decision, drift
from app.core.chamfer import chamfer_m2
from app.core.channel import Latest, Lossless
from app.core.control import Lease
from app.core.disk import free_bytes
from app.core.errors import (
    ApprovalRefused,
    DeviceError,
    DipacError,
    MotionRefused,
    PerceptionError,
    PlanningError,
    WorkerError,
    first_error,
)
from app.core.messages import (
    Decision,
    Executed,
    Frame,
    Health,
    Model,
    Notice,
    Particles,
    Proposal,
    ResumeRequest,
    StopRequest,
    Transition,
    fresh_id,
)
from app.core.ports import Camera, Clock, Operator, Recorder, Rig
from app.core.summary import Summary
from app.core.worker import Worker
from app.flow.asking import Asking
from app.flow.watching import Push, Watching
from app.perception.reconstruct import reconstruct
from app.tasks.base import Wish
from app.tasks.jobs import nominal_model, plan, uncalibrated_model, update, warm_up_stage, warm_up_stages

_OBSERVE_DEADLINE_S = 30.0
_FAILURES_IN_A_ROW = 3
_UNATTENDED_S = 120.0
"""How long a run with automatic approval waits for somebody to resume it after a stop."""
_LAST_CALIBRATION_S = 120.0
"""How long the end of an episode waits for the model to learn from its last pushes."""


@final
class Flow:
    """One episode. Build it, `await run()`, read the summary."""

    def __init__(
        self,
        wish: Wish,
        *,
        site: Site,
        rig: Rig,
        operator: Operator,
        recorder: Recorder,
        clock: Clock,
        planner: Worker,
        recording: Path | None = None,
    ) -> None:
        if wish.automatic and not rig.simulated:
            raise MotionRefused("Automatic approval is allowed on the simulated rig alone; use `dipac console`.")
        self.wish, self.site, self.rig = wish, site, rig
        self.operator, self.clock, self.summary = operator, clock, Summary()
        self.announcer = Announcer(operator=operator, recorder=recorder, clock=clock, summary=self.summary)
        self.say, self.notice, self.fault = self.announcer.say, self.announcer.notice, self.announcer.fault
        age_s, unseen_s, drift_m = site.timing.plan_max_age_s, site.timing.object_unseen_s, site.timing.plan_max_drift_m
        self.gate = ApprovalGate(max_age_s=age_s, max_unseen_s=unseen_s, max_drift_m=drift_m)
        self.perceiver = Worker("perception")
        self.planner = planner
        self.asking = Asking(wish, self.announcer, planner, site)
        self.watching = Watching(self.announcer, clock, wish.verdict, recording)
        self.calibrator = Worker("calibrator", idle=True)  # A decision waits for the planner, nothing for this.
        self.frames = {camera.model.name: Latest[Frame](f"frames {camera.model.name}") for camera in rig.cameras}
        self.particles = Latest[Particles]("particles")
        self.models = Latest[Model]("models")
        self.proposals = Latest[Proposal]("proposals")
        self.transitions = Lossless[Transition]("transitions", bound=100)
        self.decisions = Lossless[Decision]("decisions", bound=100)
        self.doing = "starting"
        self._doing_since_s = clock.now()
        self._refused = self._calibrated = 0
        self._may_move = anyio.Event()
        self._may_move.set()
        self._asking = anyio.CancelScope()
        self._began_s = self._resumed_s = clock.now()

    async def run(self) -> Summary:
        """Push until the goal is reached or the pushes are used up. Raises the first DipacError of any stage."""
        async with self.announcer.recording(), self.perceiver, self.planner, self.calibrator:
            try:
                async with anyio.create_task_group() as stages:
                    for camera in self.rig.cameras:
                        stages.start_soon(self._capture, camera)
                    for stage in (self._reconstruct, self._calibrate, self.watching.run, self._listen, self._report):
                        stages.start_soon(stage)
                    self.say(self.wish.goal)
                    await self._push_to_the_goal()
                    stages.cancel_scope.cancel()
            except BaseExceptionGroup as group:
                error = first_error(group)
                self.announcer.end(error)
                raise error from group
        return self.summary

    # The stages ---------------------------------------------------------------------------------------------------

    async def _capture(self, camera: Camera) -> None:
        """Camera -> frames; a camera that fails is reported and tried again."""
        while True:
            try:
                frame = await camera.read()
            except DeviceError as error:
                self.fault(f"camera {camera.model.name}", error)
                await self.clock.sleep(1.0)
                continue
            self.frames[camera.model.name].put(frame)
            self.say(frame)

    async def _reconstruct(self) -> None:
        """One new frame of every camera -> particles."""
        how = self.wish.task.reconstruction(self.wish.preset)
        changes = [channel.changes() for channel in self.frames.values()]
        await self.perceiver.run(callable, reconstruct)  # Starts the process and loads what it will use.
        while True:
            frames = [await anext(change) for change in changes]
            started_s = self.clock.now()
            try:
                seen = await self.perceiver.run(reconstruct, frames, how, (await self.rig.arm.state()).tool)
            except (PerceptionError, WorkerError) as error:
                self.fault("perception", error)
                continue
            now_s = self.clock.now()
            particles = Particles(
                id=fresh_id("particles"),
                cause=tuple(frame.id for frame in frames),
                time_s=min(frame.time_s for frame in frames),
                positions=seen.positions,
                surface=seen.surface,
                reconstruction_s=now_s - started_s,
            )
            self.summary.reconstruction_latency_s.append(now_s - max(frame.time_s for frame in frames))
            self.particles.put(self.say(particles))

    async def _calibrate(self) -> None:
        """Transitions -> model, in the background and never in the way of planning."""
        seen: list[Transition] = []
        async for transition in self.transitions:
            seen.append(transition)
            if self.wish.calibrating and self.models.value is not None:
                await self._update(seen, self.models.value)
            self._calibrated = len(seen)

    async def _update(self, seen: list[Transition], old: Model) -> None:
        try:
            wish = self.wish
            new = await self.calibrator.run(update, wish.task.name, wish.preset, seen, old, self.site)
        except DipacError as error:
            self.fault("calibration", error)
        else:
            self.models.put(self.say(new))

    async def _listen(self) -> None:
        """The operator's requests. The arm has stopped before a StopRequest gets here."""
        async for request in self.operator.requests():
            self.say(request)
            match request:
                case Decision():
                    await self.decisions.put(request)
                case StopRequest():
                    self._hold(f"Stopped by {request.operator}.")
                case ResumeRequest():
                    await self._resume(request)
                case Lease() | Notice():
                    pass  # Saying it is all.

    async def _resume(self, request: ResumeRequest) -> None:
        try:
            await self.rig.arm.reset(asked_s=request.time_s)
        except DeviceError as error:
            self.notice("stop", str(error))
        else:
            self._resumed_s = self.clock.now()
            self._may_move.set()
            self.notice("stop", f"Resumed by {request.operator}.")

    async def _report(self) -> None:
        """The arm's state and the health strip, at a steady pace."""
        while True:
            disk_free_bytes = await to_thread.run_sync(free_bytes, self.site.recordings, abandon_on_cancel=True)
            arm = await self.rig.arm.state()
            self.say(arm)
            now_s, model = self.clock.now(), self.models.value
            proposal, particles = self.proposals.value, self.particles.value
            self.say(
                Health(
                    id=fresh_id("health"),
                    time_s=now_s,
                    doing=f"{self.doing} ({now_s - self._doing_since_s:.0f} s)",
                    frame_age_s={name: now_s - c.value.time_s for name, c in self.frames.items() if c.value},
                    particles_age_s=now_s - particles.time_s if particles else float("inf"),
                    plan_age_s=now_s - proposal.time_s if proposal else float("inf"),
                    plan_s=proposal.plan_s if proposal else float("nan"),
                    arm_mode=arm.mode,
                    arm_period_s=arm.period_s,
                    model_version=model.version if model else 0,
                    calibration_loss_m2=model.loss_m2 if model else float("nan"),
                    drops={channel.name: channel.dropped for channel in (*self.frames.values(), self.particles)},
                    faults=len(self.summary.faults),
                    disk_free_bytes=disk_free_bytes,
                )
            )
            await self.clock.sleep(self.site.timing.health_period_s)

    # The loop -----------------------------------------------------------------------------------------------------

    async def _push_to_the_goal(self) -> None:
        """See, plan, ask, act, learn; and again."""
        await self._warm_up()
        observed = await self._settled(after_s=self._began_s)
        self.summary.chamfer_m2.append(self._to_goal(observed))
        wish, arm, attempts = self.wish, self.rig.arm, 0
        while self.summary.pushes < wish.pushes and not wish.reached(observed, (await arm.state()).tool):
            proposal = await self._plan(observed, salt=attempts)
            approved = await self._approval(proposal)
            before = self.particles.value  # what the approval was checked against, maybe minutes after the plan
            executed = await self._execute(approved) if approved else None
            attempts += 1
            observed = await self._settled(after_s=self.clock.now())
            if before and executed and executed.outcome == "completed":
                await self._learn(proposal, before, executed, observed)
        self._do("finishing the calibration")
        with anyio.move_on_after(_LAST_CALIBRATION_S):
            while min(self._calibrated, self.watching.seen) < self.summary.pushes:
                await self.clock.sleep(self.site.timing.health_period_s)
        self._do("done")

    async def _warm_up(self) -> None:
        """Compile what planning needs, by name, while the cameras already run."""
        wish, planner = self.wish, self.planner
        task, preset, method = wish.task.name, wish.preset, wish.method
        self._do("starting the planner")
        known = nominal_model if method.calibrated else uncalibrated_model
        model = self.say(wish.model or await planner.run(known, task))
        self.models.put(model)
        for index, stage in enumerate(await planner.run(warm_up_stages, task, preset, model, method)):
            self._do(f"compiling {stage}")
            await planner.run(warm_up_stage, task, preset, index, model, method)

    async def _settled(self, *, after_s: float) -> Particles:
        """The first particles whose every frame was taken with the arm at rest, `settle_s` after `after_s`."""
        await self._resumed()
        self._do("looking at the object")
        due_s = max(after_s, self._resumed_s) + self.site.timing.settle_s
        with anyio.move_on_after(_OBSERVE_DEADLINE_S):
            async for particles in self.particles.changes():
                if particles.time_s >= due_s:
                    return particles
        raise DeviceError(
            f"The object has not been seen for {_OBSERVE_DEADLINE_S:.0f} s; look at the camera images in the console, "
            "uncover the object, and start again."
        )

    async def _plan(self, observed: Particles, *, salt: int) -> Proposal:
        """Ask the planner; where it fails, again with other random branches, and the third error in a row ends it."""
        self._do("planning")
        wish, model, started_s = self.wish, self.models.value, self.clock.now()
        assert model is not None
        for attempt in range(_FAILURES_IN_A_ROW):
            seed = hash((wish.seed, self.summary.pushes, salt, attempt)) % 2**31
            try:
                x, goal, arm = observed.positions, wish.goal.positions, await self.rig.arm.state()
                found = await self.asking.plan(observed, model) or await self.planner.run(
                    plan, wish.task.name, wish.preset, x, goal, model, seed, self.site, arm.tool, wish.method
                )
            except (PlanningError, WorkerError) as error:
                self.fault("planner", error)
                if attempt + 1 == _FAILURES_IN_A_ROW:
                    raise
            else:
                return self.say(wish.proposal(found, observed, model, began_s=started_s, now_s=self.clock.now()))
        raise AssertionError("the last attempt returns or raises")

    async def _approval(self, proposal: Proposal) -> Approved | None:
        """Show the proposal and wait for the operator; None where it was rejected, refused or grew old."""
        latest, stopped = self.particles.value, not self._may_move.is_set()
        assert latest is not None
        moved_m = drift(proposal.observed, latest.positions)
        if stopped or moved_m > self.site.timing.plan_max_drift_m:
            why = "the arm was stopped" if stopped else f"the object moved by {moved_m * 1e3:.0f} mm"
            self.notice("plan", f"{proposal.id} dropped: {why} meanwhile.", proposal.id)
            return None
        self._do("waiting for approval")
        self.gate.show(proposal)
        self.proposals.put(proposal)
        with anyio.move_on_after(self.site.timing.plan_max_age_s) as self._asking:
            while True:
                decision = await self._decision(proposal)
                if self._asking.cancel_called:
                    break
                if decision.proposal_id != proposal.id:
                    self.notice("approval", f"{decision.proposal_id} is not the plan shown; nothing was done.")
                elif not decision.approve:
                    self.asking.answered()
                    why = f"Rejected by {decision.operator}: {decision.reason or 'no reason given'}."
                    self.notice("approval", why, proposal.id)
                    return None
                else:
                    return self._approved(decision)
        old = anyio.current_time() >= self._asking.deadline
        why = "grew too old" if old else "was made before the stop"
        self.notice("plan", f"{proposal.id} {why}; planning again.", proposal.id)
        return None

    async def _decision(self, proposal: Proposal) -> Decision:
        if self.wish.automatic:
            return self.say(automatic_decision(proposal, now_s=self.clock.now()))
        return await self.decisions.get()

    def _approved(self, decision: Decision) -> Approved | None:
        latest = self.particles.value
        assert latest is not None
        try:
            approved = self.gate.approve(decision, latest=latest, now_s=self.clock.now())
        except ApprovalRefused as refusal:
            self.notice("approval", str(refusal), decision.proposal_id)
            return None
        self.asking.answered()
        return self.say(approved)

    async def _execute(self, approved: Approved) -> Executed | None:
        """Make the motion; None where a stop is in force, or the arm refused it before anything moved.

        Raises the arm's MotionRefused when it has refused several motions in a row: the next would fare no better.
        """
        if not self._may_move.is_set():
            return None
        self._do("pushing")
        try:
            executed = await self.rig.arm.execute(approved)
        except MotionRefused as refusal:
            self.fault("arm", refusal)
            self._refused += 1
            if self._refused >= _FAILURES_IN_A_ROW:
                raise
            return None
        self._refused = 0
        self.summary.began_moving(executed.times_s[0] - self._began_s)
        if executed.outcome != "completed" and executed.time_s > self._resumed_s:
            self._hold(executed.reason)
        return self.say(executed)

    async def _learn(self, proposal: Proposal, before: Particles, executed: Executed, after: Particles) -> None:
        """Score the push and hand the transition to the calibrator."""
        goal, now_s = self.wish.target, self.clock.now()
        self.say(self.summary.scored(proposal, before, executed, after, goal, now_s=now_s))
        transition = Transition.between(before, executed, after, time_s=self.clock.now())
        await self.watching.put(Push(proposal, self.say(transition), self.models.value))
        await self.transitions.put(transition)

    def _hold(self, why: str) -> None:
        """Nothing moves from now on until the operator resumes, and the plan that is shown never."""
        if self._may_move.is_set():
            self._may_move = anyio.Event()
        self._asking.cancel()
        self.notice("stop", f"{why.rstrip('.')}. Press Resume to go on.")

    async def _resumed(self) -> None:
        """Wait until the operator resumes, if something stopped; for ever, unless nobody is expected to be there."""
        while not self._may_move.is_set():
            self._do("stopped")
            with anyio.move_on_after(_UNATTENDED_S if self.wish.automatic else None) as patience:
                await self._may_move.wait()
            if patience.cancelled_caught:
                raise DeviceError(f"The arm was stopped and nobody pressed Resume for {_UNATTENDED_S:.0f} s.")

    def _do(self, doing: str) -> None:
        self.doing, self._doing_since_s = doing, self.clock.now()

    def _to_goal(self, particles: Particles) -> float:
        return float(chamfer_m2(particles.positions, self.wish.target))
