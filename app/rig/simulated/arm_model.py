"""The kinematics of the drawn arm: seven revolute joints of a Gen3's order, with longer links.

A Gen3 cannot point its tool straight down over the far corners of the workspace (0.92 m from its base); this arm can.
Everything is a pure function of joint angles.
"""

from typing import TypeAlias

import numpy as np
from jaxtyping import Float64

from app.rig.simulated.physics import Position

Joints: TypeAlias = Float64[np.ndarray, "7"]
"""Joint angles [rad], from base to wrist."""
LinkFrames: TypeAlias = Float64[np.ndarray, "8 4 4"]
"""`T_world_link` of the seven links and, last, of the tool tip."""

SHOULDER_M, UPPER_ARM_M, FOREARM_M, HAND_M = 0.33, 0.54, 0.52, 0.31
"""Base to shoulder, shoulder to elbow, elbow to wrist, wrist to tool tip [m]."""

_OFFSETS_M = (SHOULDER_M, 0.0, UPPER_ARM_M / 2, UPPER_ARM_M / 2, FOREARM_M / 2, FOREARM_M / 2, HAND_M / 2)
_TIP_M = HAND_M / 2
"""Each joint lies `_OFFSETS_M` up the previous link's z axis; the tip `_TIP_M` up the last link's."""


def link_frames(joints: Joints) -> LinkFrames:
    """Forward kinematics: joints 1, 3, 5, 7 turn about the link's z axis, joints 2, 4, 6 about its y axis."""
    frames, frame = np.empty((8, 4, 4)), np.eye(4)
    for index, angle in enumerate(joints):
        frame = frame @ _joint_transform(_OFFSETS_M[index], angle, about_y=index % 2 == 1)
        frames[index] = frame
    frames[7] = frame @ _joint_transform(_TIP_M, 0.0, about_y=False)
    return frames


def solve_joints(tool: Position) -> Joints:
    """Joint angles that put the tip at `tool`, pointing straight down with its x axis along the world's.

    Closed form, elbow up: with joints 3 and 5 at zero the arm is a planar two-link arm in the vertical plane through
    the tool, and the wrist turns what is left. Out of reach, the arm stretches towards the tool.
    """
    yaw = np.arctan2(tool[1], tool[0])
    forward, up = np.hypot(tool[0], tool[1]), tool[2] + HAND_M - SHOULDER_M
    cosine = (forward**2 + up**2 - UPPER_ARM_M**2 - FOREARM_M**2) / (2 * UPPER_ARM_M * FOREARM_M)
    elbow = np.arccos(np.clip(cosine, -1.0, 1.0))
    inside = np.arctan2(FOREARM_M * np.sin(elbow), UPPER_ARM_M + FOREARM_M * np.cos(elbow))
    shoulder = np.arctan2(forward, up) - inside
    return np.array([yaw, shoulder, 0.0, elbow, 0.0, np.pi - shoulder - elbow, yaw - np.pi])


def _joint_transform(offset_m: float, angle: float, *, about_y: bool) -> Float64[np.ndarray, "4 4"]:
    """Up the z axis by `offset_m`, then turned by `angle`."""
    c, s = np.cos(angle), np.sin(angle)
    if about_y:
        return np.array([[c, 0, s, 0], [0, 1, 0, 0], [-s, 0, c, offset_m], [0, 0, 0, 1]])
    return np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, offset_m], [0, 0, 0, 1]])
