"""The tool as cameras see it, whichever it is: points whose mean is the place that kinematics tell."""

from collections.abc import Callable, Mapping, Sequence
from typing import Final, TypeAlias

import numpy as np
from jaxtyping import Float64

from app.core.geometry.shapes.tools import Finger, Paddle, Tool
from app.core.messages import Frame
from app.core.types import Cloud
from app.perception.paddle_fit import paddle_points
from app.perception.reconstruct import Reconstruction
from app.perception.tool_tip_fit import tool_points

Pose: TypeAlias = Float64[np.ndarray, "7"]
"""Pose of the tool by the kinematics: x y z [m] and a quaternion w x y z, its z axis pointing down."""


def find_tool(frames: Sequence[Frame], pose: Pose, tool: Tool, how: Reconstruction) -> Cloud:
    """Points [m] of the tool in these images; none of a tool that is not found in images, or of which little shows."""
    find = _FINDERS.get(type(tool))
    return np.zeros((0, 3), np.float32) if find is None else find(frames, pose, tool, how)


def _finger_points(frames: Sequence[Frame], pose: Pose, finger: Finger, how: Reconstruction) -> Cloud:
    if finger.half_width_m > 0:  # A flat finger's tip looks alike wherever along its width it is.
        return np.zeros((0, 3), np.float32)
    return tool_points(frames, pose[:3], how, radius_m=finger.radius_m)


def _paddle_points(frames: Sequence[Frame], pose: Pose, paddle: Paddle, how: Reconstruction) -> Cloud:
    return paddle_points(frames, pose, how, half_m=paddle.half_m)


_FINDERS: Final[Mapping[type, Callable[..., Cloud]]] = {Finger: _finger_points, Paddle: _paddle_points}
