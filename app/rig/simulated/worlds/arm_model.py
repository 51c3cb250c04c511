"""The kinematics of the drawn arm: seven revolute joints in a Gen3's order, with longer links.

A Gen3 cannot point its tool straight down over the far corners of the workspace (0.92 m from its base); this arm can.
Everything is a pure function of joint angles.
"""

from typing import TypeAlias

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.types import ToolPose

Joints: TypeAlias = Float64[np.ndarray, "7"]
"""Joint angles [rad], from base to wrist."""
LinkFrames: TypeAlias = Float64[np.ndarray, "8 4 4"]
"""`T_world_link` of the seven links and, last, of the tool tip."""

SHOULDER_M, UPPER_ARM_M, FOREARM_M, HAND_M = 0.33, 0.54, 0.52, 0.31
"""Lengths from base to shoulder, shoulder to elbow, elbow to wrist, wrist to tool tip [m]."""

OFFSETS_M = (SHOULDER_M, 0.0, UPPER_ARM_M / 2, UPPER_ARM_M / 2, FOREARM_M / 2, FOREARM_M / 2, HAND_M / 2)
_STRAIGHT = 1e-9
"""Bend of the wrist below which joints 5 and 7 share an axis, and joint 7 takes all of the rotation."""
_TIP_M = HAND_M / 2
"""Each joint lies `OFFSETS_M` up the previous link's z axis; the tip `_TIP_M` up the last link's."""


def link_frames(joints: Joints) -> LinkFrames:
    """Forward kinematics: joints 1, 3, 5, 7 turn about the link's z axis, joints 2, 4, 6 about its y axis."""
    frames, frame = np.empty((8, 4, 4)), np.eye(4)
    for index, angle in enumerate(joints):
        frame = frame @ _joint_transform(OFFSETS_M[index], angle, about_y=index % 2 == 1)
        frames[index] = frame
    frames[7] = frame @ _joint_transform(_TIP_M, 0.0, about_y=False)
    return frames


def solve_joints(tool: ToolPose) -> Joints:
    """Joint angles that put the tip at the pose `tool`, which points along its own z axis.

    Closed form, elbow up: with joint 3 at zero the arm is a planar two-link arm in the vertical plane through the
    wrist, and the three wrist joints make the remaining rotation. Out of reach, the arm stretches towards the tool.
    """
    turned = Rotation.from_quat(tool[3:7], scalar_first=True).as_matrix()
    wrist = tool[:3] - HAND_M * turned[:, 2]
    yaw = np.arctan2(wrist[1], wrist[0])
    forward, up = np.hypot(wrist[0], wrist[1]), wrist[2] - SHOULDER_M
    cosine = (forward**2 + up**2 - UPPER_ARM_M**2 - FOREARM_M**2) / (2 * UPPER_ARM_M * FOREARM_M)
    elbow = np.arccos(np.clip(cosine, -1.0, 1.0))
    inside = np.arctan2(FOREARM_M * np.sin(elbow), UPPER_ARM_M + FOREARM_M * np.cos(elbow))
    shoulder = np.arctan2(forward, up) - inside
    left = Rotation.from_euler("ZY", [yaw, shoulder + elbow]).as_matrix().T @ turned
    bend = np.arccos(np.clip(left[2, 2], -1.0, 1.0))
    if np.sin(bend) < _STRAIGHT:
        return np.array([yaw, shoulder, 0.0, elbow, 0.0, bend, np.arctan2(left[1, 0], left[1, 1])])
    roll, spin = np.arctan2(left[1, 2], left[0, 2]), np.arctan2(left[2, 1], -left[2, 0])
    # The solution of the same rotation nearest to that of an unturned tool that points down.
    untwisted = yaw - np.pi
    spin = untwisted + np.angle(np.exp(1j * (spin - untwisted)))
    return np.array([yaw, shoulder, 0.0, elbow, roll, bend, spin])


def _joint_transform(offset_m: float, angle: float, *, about_y: bool) -> Float64[np.ndarray, "4 4"]:
    """Translation up the z axis by `offset_m`, then rotation by `angle`."""
    c, s = np.cos(angle), np.sin(angle)
    if about_y:
        return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, offset_m], [0, 0, 0, 1]])
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, offset_m], [0, 0, 0, 1]])
