"""From what is held to a velocity of the tool."""

from typing import Final, TypeAlias

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.config import Limits
from app.core.jog import Jog
from app.core.motion import TOOL_DOWN
from app.core.types import ToolPose
from app.teleop.sample import Axes, FrameName, Sample

Place: TypeAlias = Float64[np.ndarray, "3"]
"""Of the tool's tip [m], in the world frame."""

_APPROACH_HZ: Final = 3.0
"""Speed over distance near an aim: from 0.3 m/s it slows down by 0.9 m/s^2, which is within what the arm may."""
_OPENING_M_S: Final = 0.1
"""At full speed a gripper of 85 mm is opened in about a second."""
_ARRIVED_M: Final = 5e-4


def along(axes: Axes, frame: FrameName, speed: float, tool: ToolPose, limits: Limits) -> Jog:
    """Along and about the axes of the frame, at the share `speed` of what the limits allow."""
    turned = _upright(tool) if frame == "tool" else Rotation.identity()
    way = np.array([axes.x, axes.y, axes.z])
    way = way / max(float(np.linalg.norm(way)), 1.0)
    return Jog(
        linear=turned.apply(way * speed * limits.speed_m_s),
        angular=turned.apply(np.array([0.0, 0.0, axes.yaw * speed * limits.angular_speed_rad_s])),
        opening=axes.grip * speed * _OPENING_M_S,
    )


def towards(aim: Place, speed: float, tool: ToolPose, limits: Limits) -> Jog:
    """Straight to `aim` [m], slower near it, and nothing once it is there."""
    way = aim - tool[:3]
    away_m = float(np.linalg.norm(way))
    if away_m < _ARRIVED_M:
        return Jog()
    return Jog(linear=way / away_m * min(speed * limits.speed_m_s, _APPROACH_HZ * away_m))


def jog(sample: Sample, tool: ToolPose, aim: Place | None, limits: Limits) -> Jog:
    """What the arm shall do for this sample: nothing where it is to go to an aim that there is not."""
    if not sample.towards:
        return along(sample.axes, sample.frame, sample.speed, tool, limits)
    return Jog() if aim is None else towards(aim, sample.speed, tool, limits)


def _upright(tool: ToolPose) -> Rotation:
    """How the tool has turned from pointing straight down."""
    return Rotation.from_quat(tool[3:7], scalar_first=True) * Rotation.from_quat(TOOL_DOWN, scalar_first=True).inv()
