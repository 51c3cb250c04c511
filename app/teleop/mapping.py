"""Mapping of held controls to a velocity of the tool."""

from typing import Final, TypeAlias

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.config import Limits
from app.core.dialogue.jog import Jog
from app.core.motion import TOOL_DOWN
from app.core.types import ToolPose
from app.teleop.sample import Axes, FrameName, Sample

Place: TypeAlias = Float64[np.ndarray, "3"]
"""Position of the tool's tip [m], in the world frame."""

_APPROACH_HZ: Final = 3.0
"""Speed over distance near a target: from 0.3 m/s it slows down by 0.9 m/s^2, within the arm's limits."""
_OPENING_M_S: Final = 0.1
"""Opening speed at full deflection: a gripper of 85 mm opens in about a second."""
_ARRIVED_M: Final = 5e-4


def along(axes: Axes, frame: FrameName, speed: float, tool: ToolPose, limits: Limits) -> Jog:
    """Velocity along and about the axes of the frame, at the share `speed` of the limits."""
    turned = _upright(tool) if frame == "tool" else Rotation.identity()
    way = np.array([axes.x, axes.y, axes.z])
    way = way / max(float(np.linalg.norm(way)), 1.0)
    return Jog(
        linear=turned.apply(way * speed * limits.speed_m_s),
        angular=turned.apply(np.array([0.0, 0.0, axes.yaw * speed * limits.angular_speed_rad_s])),
        opening=axes.grip * speed * _OPENING_M_S,
    )


def towards(aim: Place, speed: float, tool: ToolPose, limits: Limits) -> Jog:
    """Velocity straight to `aim` [m], slower near it, and zero once there."""
    way = aim - tool[:3]
    away_m = float(np.linalg.norm(way))
    if away_m < _ARRIVED_M:
        return Jog()
    return Jog(linear=way / away_m * min(speed * limits.speed_m_s, _APPROACH_HZ * away_m))


def jog(sample: Sample, tool: ToolPose, aim: Place | None, limits: Limits) -> Jog:
    """Command for this sample: zero where it goes to a target that is not set."""
    if not sample.towards:
        return along(sample.axes, sample.frame, sample.speed, tool, limits)
    return Jog() if aim is None else towards(aim, sample.speed, tool, limits)


def _upright(tool: ToolPose) -> Rotation:
    """Rotation of the tool from pointing straight down."""
    return Rotation.from_quat(tool[3:7], scalar_first=True) * Rotation.from_quat(TOOL_DOWN, scalar_first=True).inv()
