"""The simulated arm's drives: the tool follows its command with a small lag. No clock."""

from typing import final

import numpy as np
from jaxtyping import Float64

from app.arm.jogging import Jogging, finite, still
from app.arm.path import PathFollower, normalize
from app.config import Site
from app.core.dialogue.jog import Jog
from app.core.messages import ArmMode
from app.core.types import ToolPath, ToolPose
from app.rig.simulated.worlds.arm_model import Joints, solve_joints

_SERVO_TIME_S = 0.004
"""Time constant of the drives [s]: a stiff position-controlled arm."""
_ARRIVED_M, _STILL_M_S = 1e-4, 1e-3


@final
class ArmControl:
    """State of the arm between two ticks of its control loop, an `app.arm.control.Control`."""

    def __init__(self, site: Site, tool: ToolPose) -> None:
        self._limits = site.limits
        self._path: PathFollower | Jogging | None = None
        self.mode: ArmMode = "idle"
        self.reason = ""
        self.commanded, self.measured, self.velocity = tool, tool, np.zeros(3)
        self.force = np.full(3, np.nan)

    @property
    def joints(self) -> Joints:
        """Joint angles of the drawn arm with its tool at this one's [rad]."""
        return solve_joints(self.measured)

    def begin(self, points: ToolPath, speeds: Float64[np.ndarray, " S"]) -> None:
        """Follow `points`, each segment at its speed."""
        self._path = PathFollower(points, speeds, self._limits.acceleration_m_s2)
        self.mode, self.reason = "moving", ""

    def refusal(self) -> None:
        """None: a motion that has passed the gate is executed."""

    @property
    def jogging(self) -> bool:
        """True while it is being jogged, or coming to rest from that."""
        return isinstance(self._path, Jogging)

    def jog(self, jog: Jog) -> bool:
        """Command a tool velocity; True where it is accepted: while idle or jogging, and with finite numbers."""
        if not finite(jog) or not (self.mode == "idle" or (self.jogging and self.mode == "moving")):
            return False
        if self.mode == "idle" and not still(jog):
            self._path = Jogging(self.commanded, self._limits)
            self.mode, self.reason = "moving", ""
        if isinstance(self._path, Jogging):
            self._path.aim(jog)
        return True

    def decelerate(self) -> None:
        """Brake a jogged tool to rest: its commands have ceased."""
        if isinstance(self._path, Jogging):
            self._path.brake(self._limits.stop_deceleration_m_s2)

    def stop(self, reason: str) -> None:
        """Brake at the stop deceleration, or stay at rest; the first reason is kept."""
        if self.mode in ("stopping", "stopped"):
            return
        self.reason = reason
        self.mode = "stopped" if self._path is None else "stopping"
        if self._path is not None:
            self._path.brake(self._limits.stop_deceleration_m_s2)

    def reset(self) -> None:
        """Accept motions again after a stop; of no effect while the arm moves."""
        if self.mode in ("stopped", "fault"):
            self.mode, self.reason = "idle", ""

    def advance(self, duration_s: float) -> None:
        """Advance by `duration_s`."""
        if self._path is not None:
            self.commanded = self._path.advance(duration_s)
        before = self.measured
        self.measured = normalize(self.commanded + (before - self.commanded) * np.exp(-duration_s / _SERVO_TIME_S))
        self.velocity = (self.measured - before)[:3] / duration_s
        if self._path is not None and self._path.at_rest and self._has_arrived():
            self._path = None
            self.mode = "stopped" if self.mode == "stopping" else "idle"

    def close(self) -> None:
        """Release nothing: there are no resources."""

    def _has_arrived(self) -> bool:
        away, speed = np.abs(self.measured - self.commanded).max(), np.linalg.norm(self.velocity)
        return bool(away < _ARRIVED_M and speed < _STILL_M_S)
