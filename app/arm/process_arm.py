"""The application's side of an arm in its own process. Nothing here blocks on that process."""

import dataclasses
import threading
from typing import Any, Literal, Protocol, final

import anyio
import numpy as np

from app.arm.approvals import UsedApprovals
from app.arm.gate import MAX_WAYPOINTS
from app.arm.memory import MODES, ArmMemory, encode_motion
from app.config import Site
from app.core.dialogue.approval import Approved
from app.core.dialogue.jog import Jog
from app.core.errors import DeviceError, MotionRefused
from app.core.geometry.arm_geometry import JointAngles
from app.core.messages import ArmState, Executed, MessageId, fresh_id
from app.core.motion import Motion
from app.core.ports import Clock
from app.core.rejection_codes import Refusal
from app.core.system.clock import SystemClock
from app.core.system.gc_control import paused_collection
from app.core.types import ToolPose

_SILENCE_S = 2.0
"""Time without a report of state after which the arm's process counts as gone."""
_ANSWER_S, _CLEARED_S = 1.0, 5.0
"""Timeouts of a reset: until it is read, and until an arm has left its fault."""


class Process(Protocol):
    """The arm's process, as far as its client asks."""

    @property
    def exitcode(self) -> int | None:
        """Exit code; None where it has not ended."""
        ...

    def is_alive(self) -> bool:
        """True while it runs."""
        ...


@final
class ProcessArm:
    """Client of the arm's process: commands it through shared memory, and reads its log of states.

    `clock`: the time that states are dated in.
    """

    def __init__(self, memory: ArmMemory, process: Process, site: Site, clock: Clock | None = None) -> None:
        self._memory, self._process, self._site = memory, process, site
        self._clock = clock or SystemClock()
        self._states_read = memory.states.count
        self._approvals = UsedApprovals()
        self._busy = False
        self._hand = threading.Lock()

    def tool(self) -> ToolPose:
        """Pose and opening of the tool as last measured; from any thread."""
        return self._memory.states.newest()["measured"].copy()

    def joints(self) -> JointAngles:
        """Joint angles as last measured; from any thread."""
        return self._memory.states.newest()["joints"].copy()

    async def state(self) -> ArmState:
        """The newest state. Raises DeviceError where the arm's process is gone."""
        self._check_alive()
        begin = max(self._states_read - 1, 0)
        states = self._memory.states.since(begin)
        # The newest state is kept in case no tick has passed since.
        newest, unread = states[-1], states[1:] if len(states) > 1 else states
        self._states_read = begin + len(states)
        return ArmState(
            id=fresh_id("state"),
            time_s=float(newest["time_s"]),
            pose=newest["measured"][:7].copy(),
            velocity=newest["velocity"].copy(),
            joints=newest["joints"].copy(),
            gripper=1.0 - float(newest["measured"][7]) / self._site.limits.opening_m,
            opening_m=float(newest["measured"][7]),
            mode=MODES[newest["mode"]],
            period_s=float(unread["period_s"].max()),
            reason=bytes(newest["reason"]).decode(errors="ignore"),
        )

    async def execute(self, approved: Approved) -> Executed:
        """Execute the motion and wait for its end, feeding the watchdog from the event loop. Cancelling stops the arm.

        Raises MotionRefused, with nothing moved, and DeviceError where the arm's process is gone.
        """
        self._check_alive()
        self._check_leave(approved)
        self._busy = True
        try:
            with paused_collection():  # A collection over the whole application would hold the event loop.
                log = await self._run_motion(approved.motion, approved.digest)
            return _execution(log, approved.id, approved.id)
        except MotionRefused:
            raise
        except BaseException:
            # Whatever else ends the supervision early, the arm must not go on unsupervised.
            self.stop()
            raise
        finally:
            self._busy = False

    def jog(self, jog: Jog) -> bool:
        """Post a velocity command for the arm's next tick, where jogs are accepted. From any thread."""
        if not self._memory.accepts_jog.value or self.held:
            return False
        # Threads may jog at the same time, and a ring has one writer.
        with self._hand:
            self._memory.jogs.append(linear=jog.linear, angular=jog.angular, opening=jog.opening)
        return True

    async def accept_jogs(self, over: anyio.Event | None = None) -> Executed | None:
        """Accept jogs until one has ended, or until `over`; None where nothing was moved by then.

        Cancelled, the arm's process brings the tool to rest. Raises MotionRefused while a stop is in force or the arm
        is busy, and DeviceError where its process is gone.
        """
        self._check_alive()
        self._check_free()
        self._memory.keepalives.value += 1
        self._busy, self._memory.accepts_jog.value = True, 1
        try:
            log, reason = await self._stretch(over)
        finally:
            self._busy, self._memory.accepts_jog.value = False, 0
        if not len(log):
            return None
        executed = _execution(log, fresh_id("jogged"))
        return dataclasses.replace(executed, reason=executed.reason or reason)

    def stop(self) -> None:
        """Stop now: one number in shared memory, no lock, no wait."""
        self._memory.stop_ns.value = round(self._clock.now() * 1e9)

    @property
    def held(self) -> bool:
        """True while the newest requested stop has not been lifted."""
        return self._memory.stop_ns.value > self._memory.reset_ns.value

    async def reset(self, *, asked_s: float) -> None:
        """Lift a stop that came before `asked_s`, or a fault, once the arm is at rest.

        Raises DeviceError where the arm is not ready afterwards; then, and where it is cancelled, it is stopped again,
        so that the request lifts nothing later.
        """
        self._check_alive()
        try:
            await self._lift_stop(round(asked_s * 1e9))
        except BaseException:
            # A part of it still under way must lift nothing later.
            self.stop()
            raise

    async def _lift_stop(self, request_ns: int) -> None:
        memory, begun_s = self._memory, self._clock.now()
        memory.reset_ns.value = max(memory.reset_ns.value, request_ns)
        while True:
            state, waited_s = memory.states.newest(), self._clock.now() - begun_s
            heard, mode = state["reset_ns"] >= request_ns, MODES[state["mode"]]
            free, superseded = mode in ("idle", "moving"), memory.stop_ns.value > request_ns
            if heard and free and not superseded:
                return
            if (superseded and not free) or waited_s > (_CLEARED_S if heard else _ANSWER_S):
                break
            await self._clock.sleep(self._site.timing.arm_period_s)
        why = bytes(state["reason"]).decode(errors="ignore")
        raise DeviceError(
            f"The arm is still {mode}{f': {why}' if why else '.'} It was stopped again since, does not answer, or "
            "cannot leave its fault; look at it, then press Resume again."
        )

    def _check_leave(self, approved: Approved) -> None:
        """Raise MotionRefused where the approval is not valid for a motion now."""
        self._check_free()
        if len(approved.motion.positions) > MAX_WAYPOINTS:
            raise MotionRefused(Refusal.SHAPE, f"A motion has up to {MAX_WAYPOINTS} positions; thin this one out.")
        self._approvals.use(approved)

    def _check_free(self) -> None:
        """Raise MotionRefused where the arm is stopped, or under another command."""
        if self.held:
            raise MotionRefused(Refusal.STOPPED, "A stop is in force; press Resume, then try again.")
        if self._busy:
            raise MotionRefused(Refusal.BUSY, "The arm is making another motion, or moved by hand; wait for its end.")

    async def _stretch(self, over: anyio.Event | None) -> tuple[Any, str]:
        """The arm's states from its first move until it has been at rest for a while, and the reason of an early end.

        Empty where it is `over` before anything has moved.
        """
        memory, timing, reason = self._memory, self._site.timing, ""
        seen = memory.states.count
        log = memory.states.since(seen)[:0]
        while (end := _motion_end(log, timing.jog_rest_s)) is None:
            memory.keepalives.value += 1
            await self._clock.sleep(timing.keepalive_s)
            self._check_alive()
            states = memory.states.since(seen)
            seen += len(states)
            log = np.concatenate([log, states]) if len(log) else states[int(_moves(states).argmax()) :]
            if not _moves(log).any():
                log = log[:0]
                if self.held:
                    raise MotionRefused(Refusal.STOPPED, "A stop is in force; press Resume, then move the tool again.")
                if over is not None and over.is_set():
                    if not memory.accepts_jog.value:  # The arm has had time to react to the last jog.
                        return log, reason
                    memory.accepts_jog.value = 0
            elif over is not None and over.is_set():
                memory.accepts_jog.value = 0
            elif log["time_s"][-1] - log["time_s"][0] > timing.jog_longest_s and memory.accepts_jog.value:
                memory.accepts_jog.value = 0
                reason = f"Moved by hand for {timing.jog_longest_s:.0f} s without a rest, which is as long as may be."
        return log[:end], reason

    async def _run_motion(self, motion: Motion, digest: str) -> Any:
        """Post the motion, keep the watchdog fed until the arm is at rest again, and return its states meanwhile."""
        memory, seen = self._memory, self._memory.states.count
        memory.motions.append(digest=digest.encode(), **encode_motion(motion))
        number, log = memory.motions.count, memory.states.since(seen)[:0]
        while not len(log) or MODES[log["mode"][-1]] in ("moving", "stopping"):
            memory.keepalives.value += 1
            await self._clock.sleep(self._site.timing.keepalive_s)
            self._check_alive()
            states = memory.states.since(seen)
            seen += len(states)
            log = np.concatenate([log, states[states["motion"] == number]])
            self._raise_refusal(number)  # It is there before the state of an arm that is idle again.
        return log[: int(np.argmin(_moves(log))) + 1]

    def _raise_refusal(self, number: int) -> None:
        refusal = self._memory.refusals.newest()
        if refusal is not None and refusal["motion"] == number:
            code, sentence = (bytes(refusal[name]).decode(errors="ignore") for name in ("code", "reason"))
            raise MotionRefused(Refusal(code), sentence)

    def _check_alive(self) -> None:
        """Raise DeviceError where the arm's process has ended or gives no sign of life."""
        if not self._process.is_alive():
            raise DeviceError(
                f"The arm's process ended with code {self._process.exitcode}; close the rig and open it again."
            )
        silence_s = self._clock.now() - float(self._memory.states.newest()["time_s"])
        if silence_s > _SILENCE_S:
            raise DeviceError(
                f"The arm's process has said nothing for {silence_s:.1f} s; close the rig and open it again."
            )


def _moves(log: Any) -> Any:
    """Mask of the states in which the arm was moving, shape (T,)."""
    return np.isin(log["mode"], [MODES.index("moving"), MODES.index("stopping")])


def _motion_end(log: Any, rest_s: float) -> int | None:
    """Number of states up to the first of the final rest, where that has lasted; else None."""
    if not len(log) or _moves(log)[-1]:
        return None
    rest = int(np.flatnonzero(_moves(log))[-1]) + 1
    lasted = log["time_s"][-1] - log["time_s"][rest] >= rest_s
    return rest + 1 if lasted or MODES[log["mode"][-1]] != "idle" else None


def _execution(log: Any, approved_id: MessageId, *cause: MessageId) -> Executed:
    """Execution recorded in the arm's `log` of states."""
    outcomes: dict[str, Literal["completed", "stopped"]] = {"idle": "completed", "stopped": "stopped"}
    last = log[-1]
    return Executed(
        id=fresh_id("executed"),
        cause=cause,
        time_s=float(last["time_s"]),
        approved_id=approved_id,
        outcome=outcomes.get(MODES[last["mode"]], "fault"),
        reason=bytes(last["reason"]).decode(errors="ignore"),
        times_s=log["time_s"].copy(),
        commanded=log["commanded"][:, :7].copy(),
        measured=log["measured"][:, :7].copy(),
        openings=log["measured"][:, 7].copy(),
    )
