"""The arm's own process: its control loop with watchdog, and the memory through which it is told and asked."""

import contextlib
import os
import signal
import time
from typing import Any, final

import numpy as np

from app.config import Site
from app.core.errors import MotionRefused
from app.core.jog import Jog
from app.core.motion import Motion
from app.core.types import ToolPose
from app.rig.simulated.arm_control import ArmControl
from app.rig.simulated.ring import Ring, Stamp

MAX_WAYPOINTS = 1024
MODES = ("idle", "moving", "stopping", "stopped", "fault")
_TEXT_BYTES = 256
_LATEST_TICK_PERIODS = 3.0
"""A tick that comes later than this many periods moves the arm no further than this many: late, it slows."""

_STATE = np.dtype(
    [
        ("time_s", "f8"),
        ("period_s", "f8"),
        ("commanded", "f8", (8,)),
        ("measured", "f8", (8,)),
        ("velocity", "f8", (3,)),
        ("mode", "i4"),
        ("motion", "i8"),
        ("reset_ns", "i8"),
        ("reason", f"S{_TEXT_BYTES}"),
    ]
)
_MOTION = np.dtype(
    [
        ("waypoints", "i8"),
        ("digest", "S64"),
        ("turned", "?"),
        ("opened", "?"),
        ("continues", "?"),
        ("poses", "f8", (MAX_WAYPOINTS, 8)),
        ("speeds", "f8", (MAX_WAYPOINTS,)),
    ]
)
_JOG = np.dtype([("linear", "f8", (3,)), ("angular", "f8", (3,)), ("opening", "f8")])
_REFUSAL = np.dtype([("motion", "i8"), ("reason", f"S{_TEXT_BYTES}")])


@final
class ArmMemory:
    """What the arm's process shares with the application.

    Written by the application: `motions` (number n is its n-th record), `keepalives` (a number that changes while
    somebody watches the motion), `jogs` (the newest counts) and `heeding` (whether it does), `stop_ns` and `reset_ns`
    (monotonic time of the last request; a stop is in force while it is later than the last reset), `closing`. Written
    by the arm: `states`, one a tick, which name the motion begun last, and `refusals`.
    """

    def __init__(self) -> None:
        self.states = Ring(_STATE, 8192)
        self.motions = Ring(_MOTION, 2)
        self.refusals = Ring(_REFUSAL, 8)
        self.jogs, self.heeding = Ring(_JOG, 64), Stamp()
        self.keepalives, self.stop_ns, self.reset_ns, self.closing = Stamp(), Stamp(), Stamp(), Stamp()


def posted(motion: Motion) -> dict[str, object]:
    """The record of `motion` for `ArmMemory.motions`, but for its digest."""
    rows = np.zeros((MAX_WAYPOINTS, 9))
    rows[: len(motion.positions)] = np.concatenate([motion.poses, motion.speeds[:, None]], axis=1)
    return {
        "waypoints": len(motion.positions),
        "turned": len(motion.turns) > 0,
        "opened": len(motion.openings) > 0,
        "continues": motion.continues,
        "poses": rows[:, :8],
        "speeds": rows[:, 8],
    }


def _motion(request: Any) -> Motion:
    """What was posted."""
    waypoints = int(request["waypoints"])
    poses = request["poses"][:waypoints]
    return Motion(
        positions=poses[:, :3].copy(),
        speeds=request["speeds"][:waypoints].copy(),
        turns=poses[:, 3:7].copy() if request["turned"] else np.zeros((0, 4)),
        openings=poses[:, 7].copy() if request["opened"] else np.zeros(0),
        continues=bool(request["continues"]),
    )


def _jog(told: Any) -> Jog:
    """What was told."""
    return Jog(linear=told["linear"].copy(), angular=told["angular"].copy(), opening=float(told["opening"]))


def run_arm(memory: ArmMemory, site: Site, tool: ToolPose, parent: int) -> None:
    """The body of the process: tick every `site.timing.arm_period_s` until closed or until `parent` is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    _ask_for_real_time()
    loop, period = _Loop(memory, site, tool), site.timing.arm_period_s
    last = time.monotonic()
    due = last + period
    while not memory.closing.value and os.getppid() == parent:
        time.sleep(max(0.0, due - time.monotonic()))
        now = time.monotonic()
        loop.tick(now, now - last)
        due, last = max(due + period, now), now


def _ask_for_real_time() -> None:
    """Run before all ordinary processes where the system allows it, as a real arm's controller does.

    Without the right to it (CAP_SYS_NICE) the loop still wakes in time as a rule, because it uses so little.
    """
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))


@final
class _Loop:
    """The control loop between two ticks."""

    def __init__(self, memory: ArmMemory, site: Site, tool: ToolPose) -> None:
        self._memory, self._timing = memory, site.timing
        self._control = ArmControl(site, tool)
        self._heard = self._begun = self._stop_ns = self._reset_ns = self._keepalives = 0
        self._jogs = 0
        self._heard_s = self._jogged_s = 0.0

    def tick(self, now_s: float, elapsed_s: float) -> None:
        """Listen, move, report."""
        self._hear_stop_and_reset()
        self._hear_motion(now_s)
        self._hear_jogs(now_s)
        self._watch(now_s)
        self._control.advance(min(elapsed_s, _LATEST_TICK_PERIODS * self._timing.arm_period_s))
        self._report(now_s, elapsed_s)

    def _hear_stop_and_reset(self) -> None:
        """Every stop is obeyed, however soon it was lifted: a reset waits for the next tick, and for rest."""
        stop_ns, reset_ns = self._memory.stop_ns.value, self._memory.reset_ns.value
        if stop_ns != self._stop_ns:
            self._stop_ns = stop_ns
            self._control.stop("STOP was pressed.")
        elif stop_ns <= reset_ns != self._reset_ns and self._control.mode != "stopping":
            self._reset_ns = reset_ns
            self._control.reset()

    def _hear_motion(self, now_s: float) -> None:
        """Begin the newest motion that was posted since the last one, or say why not."""
        if self._memory.motions.count == self._heard:
            return
        self._heard, request = self._memory.motions.count, self._memory.motions.newest()
        motion = _motion(request)
        try:
            self._control.begin(motion, bytes(request["digest"]).decode())
            self._begun, self._heard_s = self._heard, now_s
        except MotionRefused as refusal:
            self._memory.refusals.append(motion=self._heard, reason=str(refusal).encode()[:_TEXT_BYTES])

    def _hear_jogs(self, now_s: float) -> None:
        """Follow the newest jog; where none has come for longer than the watchdog allows, or none counts, slow down."""
        memory, control = self._memory, self._control
        new, self._jogs = memory.jogs.count != self._jogs, memory.jogs.count
        if new and memory.heeding.value and control.jog(_jog(memory.jogs.newest())):
            self._jogged_s = now_s
        elif not memory.heeding.value or now_s - self._jogged_s > self._timing.watchdog_s:
            control.coast()

    def _watch(self, now_s: float) -> None:
        """Stop a motion that nobody has watched for longer than the watchdog allows.

        The time is that of hearing, on this process's clock: a sender's late or wrong stamps cannot keep the arm going.
        """
        keepalives = self._memory.keepalives.value
        if keepalives != self._keepalives:
            self._keepalives, self._heard_s = keepalives, now_s
        silence_s = now_s - self._heard_s
        followed = self._control.mode == "moving" and not self._control.jogging
        if followed and silence_s > self._timing.watchdog_s:
            self._control.stop(f"Watchdog: nothing was heard from the application for {silence_s * 1e3:.0f} ms.")

    def _report(self, now_s: float, elapsed_s: float) -> None:
        control = self._control
        self._memory.states.append(
            time_s=now_s,
            period_s=elapsed_s,
            commanded=control.commanded,
            measured=control.measured,
            velocity=control.velocity,
            mode=MODES.index(control.mode),
            motion=self._begun,
            reset_ns=self._reset_ns,
            reason=control.reason.encode()[:_TEXT_BYTES],
        )
