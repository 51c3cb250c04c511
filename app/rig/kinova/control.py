"""Control of a Gen3 in its process (`app.arm.control.Control`): nothing here blocks, the driver's threads do."""

import time
from collections.abc import Callable
from typing import final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.arm.jogging import Jogging, finite, still
from app.config import Site
from app.core.dialogue.jog import Jog
from app.core.errors import MotionRefused
from app.core.messages import ArmMode
from app.core.rejection_codes import Refusal
from app.core.types import ToolPath, ToolPose
from app.rig.kinova.arm_configuration_check import DELIVERED, Holds
from app.rig.kinova.client.clients import DEFAULT, link_by
from app.rig.kinova.client.link import Address
from app.rig.kinova.command_handle import CommandHandle
from app.rig.kinova.driver import Driver
from app.rig.kinova.feedback_conversion import ArmFeedback
from app.rig.kinova.gen3 import Joints
from app.rig.kinova.kortex import Kortex
from app.rig.kinova.path_progress import Along
from app.rig.kinova.trajectory_segments import stretches
from app.rig.kinova.workspace_limiter import hold_back

_BACK = "The connection to the arm is back; look at the arm, then press Resume."
_OFF_M, _AWAY_M = 0.015, 0.008
"""Distance of the tool from its path, and from its resting place, beyond which something else moves it [m]."""
_FOLLOW_HZ, _CATCH_UP_M_S, _CATCH_UP_RAD_S = 2.0, 0.02, 0.1
"""Gain [1/s] and limits [m/s, rad/s] of the correction that makes the tool catch up with a jogged command."""
_FINGERS_M, _AHEAD_M = 0.002, 0.013
"""Step of the fingers while jogging, and the most that their command leads their measured opening, so that the
command does not run away as they press [m]."""
_CARRIED_S = 0.05
"""Longest extrapolation of a measured pose [s]."""


def measured_joints(seen: ArmFeedback) -> Joints:
    """Joint angles of the arm itself."""
    return seen.joints


def connect_arm(
    address: Address,
    site: Site,
    client: str = DEFAULT,
    joints_of: Callable[[ArmFeedback], Joints] = measured_joints,
    holds: Holds = DELIVERED,
) -> "KinovaControl":
    """Connect to the arm at `address`, for `app.arm.process.run_arm`. Raises DeviceError where none answers.

    `joints_of`: joint angles to report, where a different arm is drawn; `holds`: the end effector that the arm must be
    configured for.
    """
    driver = Driver(Kortex(link_by(address, client)), site, holds)
    driver.open()
    return KinovaControl(driver, site, joints_of, blind_s=address.stops_after_s)


@final
class KinovaControl:
    """State of the arm between two ticks of its process.

    An arm that has sent nothing for `blind_s` must not move on; single lost datagrams are shorter than that.
    """

    def __init__(
        self,
        driver: Driver,
        site: Site,
        joints_of: Callable[[ArmFeedback], Joints] = measured_joints,
        *,
        blind_s: float,
    ) -> None:
        self._driver, self._limits, self._joints_of, self._blind_s = driver, site.limits, joints_of, blind_s
        self._handle: CommandHandle | None = None
        self._refusal: MotionRefused | None = None
        self._clearing: CommandHandle | None = None
        self._path: Along | None = None
        self._jogging: Jogging | None = None
        self._by: int | None = None
        self._heard_s = self._silence_s = self._elapsed_s = 0.0
        self._ticked_s, self._losses = time.monotonic(), driver.losses
        self._gripped_m, self._pushed, self._coasts = float(driver.feedback.tool[7]), False, False
        self._end: ToolPose | None = None
        self.mode: ArmMode = "idle"
        self.reason = ""
        self.commanded: ToolPose = driver.feedback.tool
        self.measured: ToolPose = driver.feedback.tool

    @property
    def velocity(self) -> Float64[np.ndarray, "3"]:
        """Velocity of the tool's tip [m/s]."""
        return self._driver.feedback.velocity

    @property
    def joints(self) -> Joints:
        """Joint angles [rad], each from -pi to pi."""
        return self._joints_of(self._driver.feedback)

    @property
    def force(self) -> Float64[np.ndarray, "3"]:
        """Force on the tool as the arm estimates it [N]."""
        return self._driver.feedback.force

    @property
    def jogging(self) -> bool:
        """True while it is being jogged, or coming to rest from that."""
        return self._jogging is not None

    def begin(self, points: ToolPath, speeds: Float64[np.ndarray, " S"]) -> None:
        """Have the arm validate the path, then follow it. An invalid path is refused before anything moves."""
        if why := self._unready(self._driver.feedback):
            raise MotionRefused(Refusal.DEVICE, why)
        if not len(speeds):
            return
        self._path, self._end, self._by = Along(points), points[-1], None
        ways = stretches(points, speeds, self._limits.opening_m, self._limits.angular_speed_rad_s)
        self._handle = self._driver.go(ways)
        self.mode, self.reason = "moving", ""

    def refusal(self) -> MotionRefused | None:
        """The refusal of the last path by the arm; reported once."""
        said, self._refusal = self._refusal, None
        return said

    def jog(self, jog: Jog) -> bool:
        """Command a tool velocity; False where it is not accepted."""
        if not finite(jog) or not (self.mode == "idle" or (self.jogging and self.mode == "moving")):
            return False
        if self.mode == "idle" and not still(jog):
            if self._unready(self._driver.feedback):
                return False
            self.commanded = self._driver.feedback.tool
            self._jogging = Jogging(self.commanded, self._limits)
            self._gripped_m, self._pushed, self._coasts = float(self.commanded[7]), False, False
            self._by = self._end = None
            self.mode, self.reason = "moving", ""
        if self._jogging is not None:
            self._jogging.aim(jog)
        return True

    def decelerate(self) -> None:
        """Brake a jogged tool to rest: by the arm's own Stop, which is no slower than a ramp of twists."""
        if self._jogging is not None:
            self._jogging.brake(self._limits.stop_deceleration_m_s2)
            if self._pushed:
                self._driver.stop()
                self._pushed = False
            self._coasts = True

    def stop(self, reason: str) -> None:
        """Stop the arm; the first reason is kept."""
        # Repeated even where it was sent before: a stop too many does no harm.
        self._driver.stop()
        self._clearing = None  # A stop that was being lifted is in force again.
        if self.mode in ("stopping", "stopped", "fault"):
            return
        self.reason = reason
        self.mode = "stopping" if self.mode == "moving" else "stopped"
        self._handle = self._jogging = self._path = self._end = None

    def reset(self) -> None:
        """Accept motions again; an arm in fault is asked to leave it first, and reports the faults that remain."""
        if self.mode == "stopped" and not self._driver.feedback.faults and self._driver.feedback.ready:
            self.mode, self.reason = "idle", ""
        elif self.mode in ("stopped", "fault") and not self._driver.trouble:
            self._clearing = self._driver.clear()

    def advance(self, duration_s: float) -> None:
        """Read the arm's state, and continue jogging."""
        self._driver.pulse()
        seen, now_s = self._driver.feedback, time.monotonic()
        # Counted by ticks: a delay of this process is not taken for silence of the arm.
        self._elapsed_s = now_s - self._ticked_s
        self._silence_s = self._silence_s + self._elapsed_s if seen.time_s == self._heard_s else 0.0
        self._heard_s, self._ticked_s = seen.time_s, now_s
        self.measured = extrapolate_tool(seen, time.monotonic())
        self._look_for_trouble(seen)
        if self._clearing is not None and self._clearing.over:
            self._end_clearing(self._clearing.problem)
        elif self.mode == "moving" and self._jogging is not None:
            self._push(self._jogging, seen, duration_s)
        elif self.mode == "moving" and self._handle is not None:
            self._follow(self._handle, duration_s)
        elif self.mode == "stopping" and seen.still:
            self.mode = "stopped"
        if self.mode != "moving":
            self._rest(seen, duration_s)

    def close(self) -> None:
        """Stop the arm and disconnect."""
        self._driver.close()

    def _look_for_trouble(self, seen: ArmFeedback) -> None:
        """Enter fault where the arm is in fault, unreachable, or silent."""
        why = self._driver.trouble or self._in_fault(seen)
        if self._losses != self._driver.losses:
            # A loss and reconnection between two ticks leaves no trouble.
            self._losses, why = self._driver.losses, why or _BACK
        if not why and self.mode == "moving" and (unsafe := self._unsafe(seen)):
            self.stop(unsafe)
        if why and self.mode != "fault":
            self._driver.stop()
            self.mode, self.reason = "fault", why
            self._handle = self._jogging = self._path = self._end = None
        elif why and self._clearing is None:
            self.reason = why
        elif self.mode == "fault" and self._clearing is None and self.reason.startswith("The connection"):
            self.reason = _BACK

    def _unsafe(self, seen: ArmFeedback) -> str:
        """Reason to stop the motion under way; empty where there is none."""
        if self._silence_s > self._blind_s:
            return f"The arm has said nothing for {self._blind_s:.2f} s; look at its cable, then press Resume."
        if not seen.ready:
            return "The arm is commanded at low level or serviced; have that end, then press Resume."
        if self._others(seen):
            return "Something else commands the arm: its web page, a gamepad, a program. End that, then press Resume."
        if self._path is not None and self._path.off_m > _OFF_M:
            return f"The tool is {1e3 * self._path.off_m:.0f} mm beside its way; look at it, then press Resume."
        return self._driver.refused

    def _others(self, seen: ArmFeedback) -> bool:
        """True where the arm has come to obey another connection since it began to move for this one."""
        begun = self._pushed if self._jogging is not None else self._handle is not None and self._handle.begun
        if begun and not seen.still and self._by is None:
            self._by = seen.by
        return self._by is not None and seen.by != self._by

    def _follow(self, handle: CommandHandle, duration_s: float) -> None:
        """Update the progress and the end of a motion."""
        if self._path is not None and handle.begun:
            speed_m_s = self._limits.speed_m_s
            self.commanded = self._path.advance(self.measured, speed_m_s * duration_s, speed_m_s * self._elapsed_s)
        if not handle.over:
            return
        self._handle = self._path = None
        if handle.refusal is not None:
            self.mode, self._refusal, self._end = "idle", handle.refusal, None
        elif handle.problem:
            self._driver.stop()
            self.mode, self.reason, self._end = "stopping", handle.problem, None
        else:
            self.mode = "idle"

    def _rest(self, seen: ArmFeedback, duration_s: float) -> None:
        """Follow the tool at rest: the commanded pose is where it is, or where its last motion ended."""
        if self._end is not None and np.linalg.norm(seen.tool[:3] - self._end[:3]) > _AWAY_M:
            self._end = None
        there = seen.tool if self._end is None else self._end
        # No faster than a command, as it is logged as one.
        way = _at_most(there[:3] - self.commanded[:3], self._limits.speed_m_s * duration_s)
        self.commanded = np.concatenate([self.commanded[:3] + way, there[3:]])

    def _push(self, jogging: Jogging, seen: ArmFeedback, duration_s: float) -> None:
        """Have the tool follow the jogged pose, which keeps all limits."""
        before, self.commanded = self.commanded, jogging.advance(duration_s)
        if jogging.at_rest or self._coasts:
            if self._pushed:
                self._driver.stop()
                self._pushed = False
            elif jogging.at_rest and seen.still:
                self._jogging, self.mode = None, "idle"
            return
        turn = (_rotation(self.commanded) * _rotation(before).inv()).as_rotvec() / duration_s
        behind = (_rotation(self.commanded) * _rotation(seen.tool).inv()).as_rotvec()
        linear = (self.commanded[:3] - before[:3]) / duration_s
        linear = linear + _at_most(_FOLLOW_HZ * (self.commanded[:3] - seen.tool[:3]), _CATCH_UP_M_S)
        self._pushed = True
        linear = hold_back(_at_most(linear, self._limits.speed_m_s), seen.tool[:3], self._limits)
        turn = turn + _at_most(_FOLLOW_HZ * behind, _CATCH_UP_RAD_S)
        self._driver.twist(linear, _at_most(turn, self._limits.angular_speed_rad_s))
        opening_m = max(float(self.commanded[7]), float(seen.tool[7]) - _AHEAD_M)
        if abs(opening_m - self._gripped_m) > _FINGERS_M:
            self._gripped_m = opening_m
            self._driver.grip(float(np.clip(1.0 - self._gripped_m / self._limits.opening_m, 0.0, 1.0)))

    def _end_clearing(self, problem: str) -> None:
        self._clearing = None
        self.mode, self.reason = ("fault", problem) if problem else ("idle", "")

    def _unready(self, seen: ArmFeedback) -> str:
        """Reason why the arm cannot move now; empty where it can."""
        if why := self._driver.trouble or self._in_fault(seen):
            return why
        if self._silence_s > self._blind_s:
            return "The arm does not say where it is; look at its cable."
        if np.linalg.norm(seen.tool[:3] - self.commanded[:3]) > _AWAY_M:
            return "The arm was moved by something else just now; wait until it is at rest, then plan again."
        return "" if seen.ready else "The arm is not ready: it starts, is serviced, or is commanded at low level."

    def _in_fault(self, seen: ArmFeedback) -> str:
        said = " ".join(seen.faults)
        return f"The arm is in fault: {said} Remove the cause, then press Resume." if said else ""


def extrapolate_tool(seen: ArmFeedback, now_s: float) -> ToolPose:
    """Tool pose at `now_s`, extrapolated from the last measurement by its velocity.

    So a log dated by the ticks of a loop has each pose at its time, up to the acceleration within that delay.
    """
    if seen.still:
        return seen.tool
    further = seen.velocity * min(max(now_s - seen.time_s, 0.0), _CARRIED_S)
    return np.concatenate([seen.tool[:3] + further, seen.tool[3:]])


def _at_most(vector: Float64[np.ndarray, "3"], length: float) -> Float64[np.ndarray, "3"]:
    return vector * min(1.0, length / max(float(np.linalg.norm(vector)), 1e-12))


def _rotation(pose: ToolPose) -> Rotation:
    return Rotation.from_quat(pose[3:7], scalar_first=True)
