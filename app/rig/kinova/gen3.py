"""The kinematics of a Gen3 with seven joints: forward in closed form, inverse by damped least squares.

Source of the numbers: Kinovarobotics/ros_kortex, kortex_description/arms/gen3/7dof/urdf (origins, ranges, speed limits)
and grippers/robotiq_2f_85/urdf (the arm's tool frame with that gripper). Positions are in the frame of the arm's base.
"""

from dataclasses import replace
from typing import TypeAlias

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.config import Reach
from app.core.geometry.table_place import TablePlace
from app.core.types import Transform
from app.rig.kinova.api.messages import Pose

Joints: TypeAlias = Float64[np.ndarray, "7"]
"""Joint angles [rad], from base to wrist."""
Jacobian: TypeAlias = Float64[np.ndarray, "6 7"]
"""Geometric Jacobian of the tool [m and rad, per rad], in the base's axes."""

GRIPPER_M = 0.120
"""Distance from the arm's flange to the tool frame of a Robotiq 2F-85 [m]."""
HOME: Joints = np.radians([0.0, 15.0, 180.0, -130.0, 0.0, 55.0, 90.0])
"""Joint angles of the arm's stored pose Home."""
RANGE: Joints = np.array([np.inf, 2.24, np.inf, 2.57, np.inf, 2.09, np.inf])
"""Range of each joint to either side [rad]; the odd ones are continuous."""
JOINT_SPEED: Joints = np.radians([80.0, 80.0, 80.0, 80.0, 70.0, 70.0, 70.0])
LINEAR_M_S, ANGULAR_DEG_S = 0.5, 100.0
"""Speed limits of the arm's tool."""

_ORIGINS_M = (
    (0.0, 0.0, 0.15643),
    (0.0, 0.005375, -0.12838),
    (0.0, -0.21038, -0.006375),
    (0.0, 0.006375, -0.21038),
    (0.0, -0.20843, -0.006375),
    (0.0, 0.00017505, -0.10593),
    (0.0, -0.10593, -0.00017505),
)
_ROLLS = (np.pi, np.pi / 2, -np.pi / 2, np.pi / 2, -np.pi / 2, np.pi / 2, -np.pi / 2)
FLANGE_M = 0.061525
_DAMPING = 0.02
"""Damping of the inverse: enough against runaway joints near singularities, little enough to converge in a few
steps."""
_LONGEST_STEP = 0.3
"""Longest step of an iteration [m and rad], within which the linearisation holds."""
_ARRIVED = 1e-5
_SHORT_OF_M = 0.005
"""Margin [m] before full extension, where the tool cannot move outward and the joints run fast."""
_CENTRING = 0.02
"""Gain of the null-space motion that draws the joints with a range to its middle."""


def reach(tip_m: float) -> Reach:
    """Reach with a tool whose tip is `tip_m` from its flange: up to 5 mm before full extension.

    The shoulder is the intersection of the second joint's axis with the vertical, the wrist that of the sixth with the
    fifth's. Poses folded too near to the base are not excluded.
    """
    lengths = np.abs(np.array(_ORIGINS_M))
    shoulder, hand_m = lengths[0, 2] + lengths[1, 2], lengths[6, 1] + FLANGE_M + tip_m
    upper_m, fore_m, aside_m = (
        lengths[2, 1] + lengths[3, 2],
        lengths[4, 1] + lengths[5, 2],
        lengths[2, 2] + lengths[3, 1],
    )
    stretched = float(np.hypot(upper_m + fore_m, aside_m))
    return Reach(middle=(0.0, 0.0, float(shoulder)), radius_m=stretched - _SHORT_OF_M, hand_m=float(hand_m))


def reach_over(table: TablePlace, tip_m: float) -> Reach:
    """The reach in the frame of a table at `table`."""
    own = reach(tip_m)
    x, y, z = table.points_in_table(np.array(own.middle)).tolist()
    return replace(own, middle=(x, y, z))


def _origin(offset_m: tuple[float, float, float], roll: float) -> Transform:
    frame = np.eye(4)
    frame[:3, :3], frame[:3, 3] = Rotation.from_euler("x", roll).as_matrix(), offset_m
    return frame


FIXED = tuple(_origin(offset, roll) for offset, roll in zip(_ORIGINS_M, _ROLLS, strict=True))
_TOOL = _origin((0.0, 0.0, -FLANGE_M - GRIPPER_M), np.pi)


def frames(joints: Joints) -> Float64[np.ndarray, "8 4 4"]:
    """`T_base_link` of the seven links, each turning about its own z axis, and of the tool."""
    found, frame = np.empty((8, 4, 4)), np.eye(4)
    for index, (angle, fixed) in enumerate(zip(joints, FIXED, strict=True)):
        c, s = np.cos(angle), np.sin(angle)
        frame = frame @ fixed @ np.array([[c, -s, 0, 0], [s, c, 0, 0], [0, 0, 1, 0], [0, 0, 0, 1]])
        found[index] = frame
    found[7] = frame @ _TOOL
    return found


def tool(joints: Joints) -> Transform:
    """`T_base_tool`."""
    return frames(joints)[7]


def jacobian(links: Float64[np.ndarray, "8 4 4"]) -> Jacobian:
    """Jacobian of the tool with respect to the joints, from `frames`."""
    axes = links[:7, :3, 2]
    return np.concatenate([np.cross(axes, links[7, :3, 3] - links[:7, :3, 3]).T, axes.T])


def away(links: Float64[np.ndarray, "8 4 4"], target: Transform) -> Float64[np.ndarray, "6"]:
    """Pose error of the tool to `target` [m and rad]."""
    turn = Rotation.from_matrix(target[:3, :3] @ links[7, :3, :3].T).as_rotvec()
    return np.concatenate([target[:3, 3] - links[7, :3, 3], turn])


def nearer(joints: Joints, target: Transform, *, centring: float = 0.0) -> Joints:
    """One step of damped least squares towards `target`, within the joints' ranges."""
    links = frames(joints)
    J, error = jacobian(links), away(links, target)
    error *= min(1.0, _LONGEST_STEP / max(float(np.abs(error).max()), _ARRIVED))
    inverse = J.T @ np.linalg.inv(J @ J.T + _DAMPING**2 * np.eye(6))
    config = np.where(np.isfinite(RANGE), -centring * joints, 0.0)
    moved = joints + inverse @ error + (np.eye(7) - inverse @ J) @ config
    return np.clip(moved, -RANGE, RANGE)


def solve_joints(target: Transform, guess: Joints, *, steps: int = 120, within_m: float = 5e-4) -> Joints | None:
    """Joints near `guess` whose tool is at `target` to `within_m` [m and rad]; None where none are found."""
    joints = guess
    for step in range(steps):
        if float(np.abs(away(frames(joints), target)).max()) < within_m:
            return joints
        # No centring in the end: it would keep the tool from its target.
        joints = nearer(joints, target, centring=_CENTRING if step < steps // 2 else 0.0)
    return None


def pose(frame: Transform) -> Pose:
    """Pose message of the arm: metres, and Euler angles [degrees] about the fixed x, y and z axis."""
    x, y, z = (float(each) for each in frame[:3, 3])
    turn = Rotation.from_matrix(frame[:3, :3]).as_euler("xyz", degrees=True)
    return Pose(x=x, y=y, z=z, theta_x=float(turn[0]), theta_y=float(turn[1]), theta_z=float(turn[2]))


def transform(said: Pose) -> Transform:
    """Transform of a pose message, the inverse of `pose`."""
    frame = np.eye(4)
    angles = [said.theta_x, said.theta_y, said.theta_z]
    frame[:3, :3] = Rotation.from_euler("xyz", angles, degrees=True).as_matrix()
    frame[:3, 3] = said.x, said.y, said.z
    return frame
