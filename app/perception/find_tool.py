"""The tool as cameras see it, whichever it is: points whose mean is its place."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Float64

from app.core.geometry.shapes.tools import Tool
from app.core.messages import Frame
from app.core.types import OPENING, Cloud
from app.perception.bowl_fit import bowl_points
from app.perception.paddle_fit import gripper_points, paddle_points
from app.perception.reconstruct import Reconstruction
from app.perception.tool_tip_fit import tool_points

Pose: TypeAlias = Float64[np.ndarray, " D"]
"""Pose of the tool by the kinematics: x y z [m] and a quaternion w x y z, its z axis pointing down; then its opening
[m], of a tool that opens."""


def find_tool(frames: Sequence[Frame], pose: Pose, tool: Tool, how: Reconstruction) -> Cloud:
    """Points [m] of the tool in these images; none of a tool that has no part to be found by, or shows too little."""
    if tool.ball_m is not None:
        return tool_points(frames, pose[:3], how, radius_m=tool.ball_m)
    if tool.board_m is not None:
        return paddle_points(frames, pose, how, half_m=tool.board_m)
    if tool.fingers is not None and len(pose) > OPENING and pose[OPENING] < tool.fingers.closed_m:
        return gripper_points(frames, pose, how, half_m=tool.fingers.half_m)
    if tool.bowl_m is not None:
        return bowl_points(frames, pose, how, radius_m=tool.bowl_m)
    return np.zeros((0, 3), np.float32)
