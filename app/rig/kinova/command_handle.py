"""Command that takes the arm a while: its handle, and its execution segment by segment."""

import time
from collections.abc import Callable
from typing import final

import numpy as np
from scipy.spatial.transform import Rotation

from app.core.errors import DeviceError, MotionRefused
from app.core.rejection_codes import Refusal
from app.core.types import ToolPose
from app.rig.kinova.api.codes import ActionEvent
from app.rig.kinova.api.error_messages import TRAJECTORY_INFO, refusal
from app.rig.kinova.api.messages import ActionNotification
from app.rig.kinova.feedback_conversion import ArmFeedback
from app.rig.kinova.kortex import Kortex
from app.rig.kinova.trajectory_segments import TrajectorySegment

NEAR_M, NEAR_RAD = 0.004, np.radians(3.0)
"""Distance and angle from its end within which the tool has arrived. Arms report ends not reached (ros_kortex #116)."""
_POLL_S, _SETTLE_S, _SLACK_S, _SLOWER = 0.010, 0.5, 12.0, 3.0
_FINGERS_S, _FINGERS_STILL_S, _CLOSE_ENOUGH = 3.0, 0.3, 0.02


class Preempted(Exception):
    """A stop has come since; the command is not continued."""


@final
class CommandHandle:
    """Handle of a command: `begun` once something moves; `over` once it has ended, `problem` then gives its error.

    `refusal`: the arm rejected it, and nothing has moved.
    """

    def __init__(self) -> None:
        self.begun, self.over, self.problem = False, False, ""
        self.refusal: MotionRefused | None = None

    def end(self, problem: str) -> None:
        """Record its end."""
        self.problem = problem
        self.over = True


def execute_path(
    handle: CommandHandle,
    kortex: Kortex,
    grip: Callable[[float], None],
    stretches: tuple[TrajectorySegment, ...],
    check: Callable[[], None],
    look: Callable[[], ArmFeedback],
) -> None:
    """Have the arm validate all waypoints, then execute segment by segment, the fingers by `grip`.

    `check` raises Superseded once it must not go on. Raises MotionRefused, with nothing moved, where the arm rejects
    the path; DeviceError where it aborts, does not finish, or does not arrive.
    """
    if ways := [way for stretch in stretches for way in stretch.ways]:
        try:
            kortex.check(ways)
        except MotionRefused as refused:
            handle.refusal = refused
            raise
    for stretch in stretches:
        check()
        if stretch.closed is not None:
            grip(stretch.closed)
        if stretch.ways:
            _go(handle, kortex, stretch, check)
            _arrive(stretch.end, check, look)
        elif stretch.closed is not None:
            _close(stretch.closed, check, look)


def _go(handle: CommandHandle, kortex: Kortex, stretch: TrajectorySegment, check: Callable[[], None]) -> None:
    """Follow the waypoints until the arm reports the end."""
    kortex.events()
    check()
    kortex.go(stretch.ways)
    known, end = False, time.monotonic() + _SLACK_S + _SLOWER * stretch.duration_s
    while time.monotonic() < end:
        check()
        for each in kortex.events():
            if not isinstance(each, ActionNotification):
                continue
            # Earlier events are of another action.
            known = known or each.action_event in (ActionEvent.PREPROCESS_START, ActionEvent.START)
            handle.begun = handle.begun or each.action_event == ActionEvent.START
            if known and each.action_event == ActionEvent.END:
                return
            if known and each.action_event in (ActionEvent.ABORT, ActionEvent.PREPROCESS_ABORT):
                raise DeviceError(_broken_off(each))
        time.sleep(_POLL_S)
    raise MotionRefused(Refusal.STUCK, "The arm does not come to the end of its way; look at it, then press Resume.")


def _broken_off(said: ActionNotification) -> str:
    reasons = [
        TRAJECTORY_INFO[each.trajectory_info_type]
        for each in said.trajectory_info
        if each.trajectory_info_type in TRAJECTORY_INFO
    ]
    return f"The arm broke off its way: {refusal(said.abort_details, '; '.join(reasons))}"


def _arrive(end: ToolPose, check: Callable[[], None], look: Callable[[], ArmFeedback]) -> None:
    """Raise DeviceError where the tool is not at `end`, after a settling time."""
    until = time.monotonic() + _SETTLE_S
    while True:
        check()
        tool = look().tool
        off_m = float(np.linalg.norm(tool[:3] - end[:3]))
        off_rad = float((_rotation(tool).inv() * _rotation(end)).magnitude())
        if off_m < NEAR_M and off_rad < NEAR_RAD and look().still:
            return
        if time.monotonic() > until:
            raise DeviceError(
                f"The arm says that it has arrived, and its tool is {1e3 * off_m:.0f} mm and {np.degrees(off_rad):.0f} "
                "degrees away from there; look at what holds it, then press Resume."
            )
        time.sleep(_POLL_S)


def _close(closed: float, check: Callable[[], None], look: Callable[[], ArmFeedback]) -> None:
    """Wait until the fingers arrive, or have not moved for a while: then they hold something."""
    begun = moved = time.monotonic()
    before = look().closed
    while time.monotonic() - begun < _FINGERS_S and time.monotonic() - moved < _FINGERS_STILL_S:
        check()
        now = look().closed
        if abs(now - closed) < _CLOSE_ENOUGH:
            return
        if abs(now - before) > 1e-3:
            before, moved = now, time.monotonic()
        time.sleep(_POLL_S)


def _rotation(pose: ToolPose) -> Rotation:
    return Rotation.from_quat(pose[3:7], scalar_first=True)
