"""Next best view: the gripper pose that most reduces the uncertainty of the camera's pose.

Poses are sampled in which the camera sees the whole board, and the gripper stays in the workspace and near its
orientation so far. The one with the smallest sum of variances of the camera's pose is chosen, a radian counting as the
distance at which the camera looks (A-optimal design).
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Bool, Float64

from app.config import Workspace
from app.core.geometry.charuco import Charuco
from app.core.geometry.hand_eye import Setup
from app.core.geometry.lens import Lens
from app.core.types import Transform
from app.perception.calibration.chain import Ends, outer
from app.perception.calibration.refine import Corners, information
from app.perception.calibration.se3 import angle, exp, inverse, mean, transform, transform_points
from app.perception.calibration.solve import CalibrationView, corners_of

_DRAWN, _WEIGHED = 4000, 60
_NEAREST_M, _FARTHEST_M = 0.25, 1.1
_TILT_RAD = np.radians(40.0)
"""Largest tilt of the board from its mean orientation to the camera: steeper, corners blur and markers are lost."""
_FACING = np.cos(np.radians(60.0))
_REACH_RAD = np.radians(45.0)
"""Largest rotation of the gripper from its mean orientation: the range of a wrist in a pose reached by hand."""
_BORDER_PX = 12.0
_CLEAR_M = 0.02
"""Clearance between the board and the table."""
_KNOWN_M, _KNOWN_RAD = 0.05, np.radians(3.0)
"""Prior standard deviations of both ends before any view: a cell measured with a tape."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class NextPose:
    """The next pose, and the worst-axis standard deviation of the camera's position [m] now and with that view."""

    T_world_gripper: Transform
    deviation_m: float
    promised_m: float


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class HandEyeSetup:
    """The observation set-up: lens, board, which of board and camera the gripper has, and the approximate ends."""

    lens: Lens
    board: Charuco
    setup: Setup
    ends: Ends


def about(views: Sequence[CalibrationView], X: Transform, lens: Lens, board: Charuco, setup: Setup) -> HandEyeSetup:
    """The set-up with the board located by at least one view, for a camera approximately at `X`."""
    H = outer(np.array([view.T_world_gripper for view in views]), setup)
    C = np.array([view.sight.T_camera_board for view in views])
    return HandEyeSetup(lens=lens, board=board, setup=setup, ends=Ends(X=X, Y=mean(inverse(H) @ X @ C)))


def next_pose(
    eye: HandEyeSetup, views: Sequence[CalibrationView], workspace: Workspace, rng: np.random.Generator
) -> NextPose | None:
    """The best of many sampled poses; None where the board is visible in none of them. Needs one view at least."""
    poses = np.array([view.T_world_gripper for view in views])
    drawn = _sample_poses(eye, views, rng)
    H = eye.ends.X @ drawn @ inverse(eye.ends.Y)
    grippers = outer(H, eye.setup)
    possible = np.flatnonzero(_is_visible(eye, drawn) & _is_reachable(eye, H, grippers, poses, workspace))[:_WEIGHED]
    if not len(possible):
        return None
    known = _prior() + sum(information(eye.ends, each, eye.lens, eye.setup) for each in _nominal(eye, views))
    scale = np.array([float(np.median([view.sight.T_camera_board[2, 3] for view in views]))] * 3 + [1.0] * 3)
    left = [np.linalg.inv(known + _view_information(eye, H[index])) for index in possible]
    best = int(np.argmin([np.sum(np.diag(each)[:6] * scale**2) for each in left]))
    return NextPose(
        T_world_gripper=grippers[possible[best]],
        deviation_m=_worst_m(np.linalg.inv(known)),
        promised_m=_worst_m(left[best]),
    )


def _sample_poses(
    eye: HandEyeSetup, views: Sequence[CalibrationView], rng: np.random.Generator
) -> Float64[np.ndarray, "D 4 4"]:
    """Sampled poses of the board in front of the camera: anywhere in its image, near and far, tilted from its mean."""
    lens, middle = eye.lens, np.array([*eye.board.size_m, 0.0]) / 2
    depth = rng.uniform(_NEAREST_M, _FARTHEST_M, _DRAWN)
    pixel = rng.uniform([0, 0], [lens.width - 1, lens.height - 1], (_DRAWN, 2))
    place = np.concatenate([pixel, np.ones((_DRAWN, 1))], axis=1) @ np.linalg.inv(lens.K).T * depth[:, None]
    usual = mean(np.array([view.sight.T_camera_board for view in views]))[:3, :3]
    axis = rng.standard_normal((_DRAWN, 3))
    axis /= np.linalg.norm(axis, axis=1, keepdims=True)
    turned = exp(axis * rng.uniform(0, _TILT_RAD, (_DRAWN, 1))) @ usual
    return transform(turned, place - turned @ middle)


def _is_visible(eye: HandEyeSetup, C: Float64[np.ndarray, "D 4 4"]) -> Bool[np.ndarray, " D"]:
    """Mask of the poses in which the whole board is in the image and faces the camera."""
    outline = transform_points(C, np.broadcast_to(eye.board.outline(), (len(C), 4, 3)))
    ahead = np.all(outline[..., 2] > _NEAREST_M / 2, axis=1)
    pixels = eye.lens.project(np.maximum(outline, [-np.inf, -np.inf, _NEAREST_M / 2]))
    most = np.array([eye.lens.width, eye.lens.height]) - _BORDER_PX
    middle = outline.mean(axis=1)
    facing = np.einsum("di,di->d", C[:, :3, 2], middle) / np.linalg.norm(middle, axis=1)
    return ahead & np.all((pixels > _BORDER_PX) & (pixels < most), axis=(1, 2)) & (facing > _FACING)


def _is_reachable(
    eye: HandEyeSetup,
    H: Float64[np.ndarray, "D 4 4"],
    grippers: Float64[np.ndarray, "D 4 4"],
    poses: Float64[np.ndarray, "V 4 4"],
    workspace: Workspace,
) -> Bool[np.ndarray, " D"]:
    """Mask of the poses within the gripper's workspace and orientation range, with the board clear of the table."""
    places = grippers[:, :3, 3]
    inside = np.all((places >= workspace.low) & (places <= workspace.high), axis=1)
    near = angle(grippers[:, :3, :3] @ mean(poses)[:3, :3].T) < _REACH_RAD
    if eye.setup == "wrist":
        return inside & near
    outline = transform_points(H @ eye.ends.Y, np.broadcast_to(eye.board.outline(), (len(H), 4, 3)))
    return inside & near & np.all(outline[..., 2] > _CLEAR_M, axis=1)


def _nominal(eye: HandEyeSetup, views: Sequence[CalibrationView]) -> list[Corners]:
    return corners_of(views, eye.board, eye.setup)


def _view_information(eye: HandEyeSetup, H: Transform) -> Float64[np.ndarray, "12 12"]:
    """Information matrix of a view of the whole board at that pose."""
    points = eye.board.corners()
    view = Corners(H=H, points=points, pixels=np.zeros((len(points), 2)))
    return information(eye.ends, view, eye.lens, eye.setup)


def _prior() -> Float64[np.ndarray, "12 12"]:
    return np.diag(([_KNOWN_RAD**-2] * 3 + [_KNOWN_M**-2] * 3) * 2)


def _worst_m(covariance: Float64[np.ndarray, "12 12"]) -> float:
    return float(np.sqrt(np.diag(covariance)[3:6].max()))
