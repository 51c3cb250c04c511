"""The kinematic chain from the board to the pixels by way of the robot: predictions and their derivatives.

Both set-ups are one equation, H Y = X C. A camera that stands in the world and looks at a board in the gripper has H =
T_world_gripper, Y = T_gripper_board, X = T_world_camera; one on the wrist that looks at a board in the world has H =
T_gripper_world, Y = T_world_board, X = T_gripper_camera. C is T_camera_board. X and Y are the unknowns.
"""

from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.hand_eye import Setup
from app.core.geometry.lens import Lens
from app.core.types import Transform
from app.perception.calibration.se3 import cross, exp, inverse, transform, transform_points

Jacobian: TypeAlias = Float64[np.ndarray, "R 12"]
"""Jacobian with respect to X and then Y: rotation about the axes of the outer frame [rad], then translation along
them [m]."""

PIXEL_PX = 0.1
"""Standard deviation of a refined corner [pixel]; 0.03 to 0.25 depending on the images
(docs/calibration-cameras.md)."""
JOINTS_M, JOINTS_RAD = 0.0003, np.radians(0.03)
"""Standard deviations of the gripper's pose reported by the arm. A first guess, scaled later by the residuals."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Ends:
    """The two unknown transforms of the chain."""

    X: Transform
    Y: Transform

    def shift(self, by: Float64[np.ndarray, "12"]) -> "Ends":
        """The transforms rotated and shifted by an increment, as in a `Jacobian`."""
        return Ends(X=_shift(self.X, by[:6]), Y=_shift(self.Y, by[6:]))

    def board_before(self, H: Float64[np.ndarray, "*stack 4 4"]) -> Float64[np.ndarray, "*stack 4 4"]:
        """`T_camera_board` predicted from the robot's pose."""
        return inverse(self.X) @ H @ self.Y


def outer(T_world_gripper: Float64[np.ndarray, "*stack 4 4"], setup: Setup) -> Float64[np.ndarray, "*stack 4 4"]:
    """`H` for the gripper's pose; also its inverse."""
    return T_world_gripper if setup == "fixed" else inverse(T_world_gripper)


def residuals(
    ends: Ends, H: Transform, points: Float64[np.ndarray, "C 3"], pixels: Float64[np.ndarray, "C 2"], lens: Lens
) -> Float64[np.ndarray, " R"]:
    """Reprojection errors of the corners [pixel], shape (2 C,)."""
    return (lens.project(transform_points(ends.board_before(H), points)) - pixels).ravel()


def slopes(
    ends: Ends, H: Transform, points: Float64[np.ndarray, "C 3"], lens: Lens, setup: Setup
) -> tuple[Jacobian, Float64[np.ndarray, "R 6"]]:
    """Derivatives of `residuals` with respect to both ends, and to an error of the gripper's pose about its origin.

    With R and t those of X, a point P of H Y p is at q = R' (P - t) in the camera's frame; a rotation w of X about its
    own origin makes that R' (P - t - w x (P - t)).
    """
    turned = points @ ends.Y[:3, :3].T
    P = transform_points(H @ ends.Y, points)
    back, gripper = ends.X[:3, :3].T, H[:3, 3] if setup == "fixed" else np.zeros(3)
    whole = np.broadcast_to(np.eye(3), (len(points), 3, 3))
    dq_dX = back @ np.concatenate([cross(P - ends.X[:3, 3]), -whole], axis=2)
    dq_dY = back @ H[:3, :3] @ np.concatenate([-cross(turned), whole], axis=2)
    dq_dH = back @ np.concatenate([-cross(P - gripper), whole], axis=2)
    dpixel = _pinhole_slope((P - ends.X[:3, 3]) @ ends.X[:3, :3], lens)
    both = dpixel @ np.concatenate([dq_dX, dq_dY], axis=2)
    return both.reshape(-1, 12), (dpixel @ dq_dH).reshape(-1, 6)


def whiten(by_H: Float64[np.ndarray, "R 6"], columns: Float64[np.ndarray, "R _"]) -> Float64[np.ndarray, "R _"]:
    """S^-1 times `columns`, with S the covariance of one view's residuals.

    Corner errors are independent, and an error of the gripper's pose moves all of them together: S = s^2 I + B B',
    inverted by Woodbury's identity.
    """
    B = by_H * ([JOINTS_RAD] * 3 + [JOINTS_M] * 3)
    inner = np.linalg.solve(PIXEL_PX**2 * np.eye(6) + B.T @ B, B.T @ columns)
    return (columns - B @ inner) / PIXEL_PX**2


def _pinhole_slope(q: Float64[np.ndarray, "C 3"], lens: Lens) -> Float64[np.ndarray, "C 2 3"]:
    """Derivative of the pixel (K q / z) with respect to q."""
    z = q[:, 2]
    slope = lens.K[:2] / z[:, None, None]
    slope[:, :, 2] -= (q @ lens.K[:2].T) / z[:, None] ** 2
    return slope


def _shift(T: Transform, by: Float64[np.ndarray, "6"]) -> Transform:
    return transform(exp(by[:3]) @ T[:3, :3], T[:3, 3] + by[3:])
