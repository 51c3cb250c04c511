"""What the arm does with what it is told: modes, limits and the motion itself. No clock, no process."""

from typing import final

import numpy as np

from app.config import Limits, Site
from app.core.errors import MotionRefused
from app.core.jog import Jog
from app.core.messages import ArmMode
from app.core.motion import Motion
from app.core.types import ToolPose
from app.rig.simulated.jogging import Jogging, finite, still
from app.rig.simulated.path import PathFollower, route, whole

_SERVO_TIME_S = 0.004
"""Time constant with which the drives follow their command: a stiff position-controlled arm."""
_ARRIVED_M, _STILL_M_S = 1e-4, 1e-3
_ROUNDING = 1e-9
_JOINED_M, _UNIT = 0.005, 1e-6
"""How far from the tool a motion that continues may begin, and how far from unit length a quaternion may be."""


@final
class ArmControl:
    """The arm between two ticks of its control loop.

    `commanded` and `measured` are the tool's pose, `velocity` the measured one of its tip [m/s]. A stop holds until
    `reset`.
    """

    def __init__(self, site: Site, tool: ToolPose) -> None:
        self._site = site
        self._path: PathFollower | Jogging | None = None
        self.mode: ArmMode = "idle"
        self.reason = ""
        self.commanded, self.measured, self.velocity = tool, tool, np.zeros(3)

    def begin(self, motion: Motion, digest: str) -> None:
        """Start `motion`. Raises MotionRefused, with nothing moved, where it was not approved or is not allowed."""
        if self.mode != "idle":
            raise MotionRefused(f"The arm is {self.mode}; wait for its end, or reset it after a stop.")
        check_motion(motion, digest, self._site)
        away_m = float(np.linalg.norm(motion.positions[0] - self.commanded[:3]))
        if motion.continues and away_m > _JOINED_M:
            raise MotionRefused(
                f"The motion continues from where the tool was, and the tool is {1e3 * away_m:.0f} mm away; plan again."
            )
        points, speeds = route(self.commanded, motion, self._site)
        if not self._site.limits.workspace.contains(points[:, :3]):
            raise MotionRefused("The way to the motion leaves the workspace; lower the travel height.")
        self._path = PathFollower(points, speeds, self._site.limits.acceleration_m_s2)
        self.mode, self.reason = "moving", ""

    @property
    def jogging(self) -> bool:
        """Whether it is being moved by hand, or coming to rest from that."""
        return isinstance(self._path, Jogging)

    def jog(self, jog: Jog) -> bool:
        """Move so from now on; whether that was heeded: it is while idle or jogging already, and all is finite."""
        if not finite(jog) or not (self.mode == "idle" or (self.jogging and self.mode == "moving")):
            return False
        if self.mode == "idle" and not still(jog):
            self._path = Jogging(self.commanded, self._site.limits)
            self.mode, self.reason = "moving", ""
        if isinstance(self._path, Jogging):
            self._path.aim(jog)
        return True

    def coast(self) -> None:
        """Slow down to rest where it is jogged: nobody says any more how it shall move."""
        if isinstance(self._path, Jogging):
            self._path.aim(Jog())

    def stop(self, reason: str) -> None:
        """Brake at the stop deceleration, or stay where it is; the first reason is kept."""
        if self.mode in ("stopping", "stopped"):
            return
        self.reason = reason
        self.mode = "stopped" if self._path is None else "stopping"
        if self._path is not None:
            self._path.brake(self._site.limits.stop_deceleration_m_s2)

    def reset(self) -> None:
        """Accept motions again after a stop; of no effect while the arm moves."""
        if self.mode in ("stopped", "fault"):
            self.mode, self.reason = "idle", ""

    def advance(self, duration_s: float) -> None:
        """Let `duration_s` pass."""
        if self._path is not None:
            self.commanded = self._path.advance(duration_s)
        before = self.measured
        self.measured = whole(self.commanded + (before - self.commanded) * np.exp(-duration_s / _SERVO_TIME_S))
        self.velocity = (self.measured - before)[:3] / duration_s
        if self._path is not None and self._path.at_rest and self._arrived():
            self._path = None
            self.mode = "stopped" if self.mode == "stopping" else "idle"

    def _arrived(self) -> bool:
        away, speed = np.abs(self.measured - self.commanded).max(), np.linalg.norm(self.velocity)
        return bool(away < _ARRIVED_M and speed < _STILL_M_S)


def check_motion(motion: Motion, digest: str, site: Site) -> None:
    """Raise MotionRefused with the reason where `motion` is not the approved one, or outside the limits of `site`."""
    if motion.digest() != digest:
        raise MotionRefused("The motion is not the one that was approved (its digest differs); plan and approve again.")
    positions, speeds, limits = motion.positions, motion.speeds, site.limits
    if len(positions) == 0 or len(positions) != len(speeds):
        raise MotionRefused(f"A motion needs a speed for each position; it has {len(positions)} and {len(speeds)}.")
    if not (np.all(np.isfinite(positions)) and np.all(np.isfinite(speeds))):
        raise MotionRefused("The motion holds numbers that are not finite; plan again.")
    if not limits.workspace.contains(positions):
        box = limits.workspace
        raise MotionRefused(f"The motion leaves the workspace {box.low} to {box.high} m; plan inside it.")
    _check_tool(motion, limits)
    if np.any(speeds <= 0) or np.any(speeds > limits.speed_m_s * (1 + _ROUNDING)):
        fastest = float(np.max(speeds))
        raise MotionRefused(f"Speeds must be above 0 and up to {limits.speed_m_s} m/s; the fastest is {fastest:.3f}.")


def _check_tool(motion: Motion, limits: Limits) -> None:
    """Raise MotionRefused where the tool is to turn or open in a way that it cannot."""
    for name, told in (("turns", motion.turns), ("openings", motion.openings)):
        if len(told) not in (0, len(motion.positions)):
            raise MotionRefused(f"A motion needs as many {name} as positions, or none; it has {len(told)}.")
    if not (np.abs(np.linalg.norm(motion.turns, axis=1) - 1) < _UNIT).all():
        raise MotionRefused("The motion turns the tool by quaternions that are not of unit length; plan again.")
    if not ((motion.openings >= 0) & (motion.openings <= limits.opening_m)).all():
        raise MotionRefused(f"The motion opens the tool beyond 0 to {limits.opening_m} m; plan inside that.")
