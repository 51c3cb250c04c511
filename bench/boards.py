"""Views of a ChArUco board from known cameras and known robot poses: corners alone, or whole images to detect it in."""

from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from functools import lru_cache
from typing import final

import cv2
import numpy as np
from jaxtyping import Float64, UInt8

from app.core.errors import PerceptionError
from app.core.geometry.charuco import Charuco
from app.core.geometry.hand_eye import Setup
from app.core.geometry.lens import Lens
from app.core.types import ColourImage, Transform
from app.perception.calibration.chain import outer
from app.perception.calibration.se3 import exp, inverse, transform, transform_points
from app.perception.calibration.sight import BoardDetection, opencv_board, sight
from app.perception.calibration.solve import CalibrationView

BOARD = Charuco()
LENS = Lens(width=640, height=480, K=np.array([[605.0, 0.0, 319.5], [0.0, 603.0, 239.5], [0.0, 0.0, 1.0]]))
_FINE = 3
"""Rays a pixel in each direction."""
_TEXTURE_PX_M = 3000.0
_HELD: Mapping[Setup, tuple[list[float], list[float]]] = {
    "fixed": ([0.2, 0.1, 0.3], [-0.10, -0.05, 0.08]),
    "wrist": ([3.0, 0.1, 0.3], [0.5, -0.1, 0.0]),
}
"""Pose of the board in the gripper, and on the table with its pattern up: rotation vector [rad] and place [m]."""


@final
@dataclass(frozen=True, kw_only=True)
class Camera:
    """Image degradation: noise [grey levels], blur [pixel], and a falloff of light across the image (a share)."""

    noise: float = 3.0
    blur_px: float = 0.7
    shade: float = 0.4


@final
@dataclass(frozen=True, kw_only=True)
class Errors:
    """Other errors: of the arm's reported pose on each axis, and a share of views whose pose is another one's."""

    joints_m: float = 0.0
    joints_deg: float = 0.0
    outliers: float = 0.0


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Cell:
    """The truth: where camera and board are, and how the board is held before the camera in each view."""

    setup: Setup
    X: Transform
    Y: Transform
    C: Float64[np.ndarray, "V 4 4"]

    @property
    def grippers(self) -> Float64[np.ndarray, "V 4 4"]:
        """`T_world_gripper` of each view."""
        return outer(self.X @ self.C @ inverse(self.Y), self.setup)


def cell(seed: int, views: int, setup: Setup = "fixed", *, tilt_deg: float = 35.0, distance_m: float = 0.5) -> Cell:
    """A camera about as in the rope's cell, and a board about `distance_m` before it, tilted to all sides."""
    rng = np.random.default_rng([seed, 1])
    X = _pose(rng, [np.pi * 0.75, 0.1, 0.2], [0.55, 0.50, 0.55] if setup == "fixed" else [0.03, 0.06, 0.02])
    Y = _pose(rng, *_HELD[setup])
    return Cell(setup=setup, X=X, Y=Y, C=np.array([_before(rng, tilt_deg, distance_m) for _ in range(views)]))


def seen(
    truth: Cell, seed: int, errors: Errors, camera: Camera | None = None, noise_px: float = 0.15
) -> list[CalibrationView]:
    """Views as cameras and arm report them: of rendered images, or of exact corners with noise where no camera is.

    An image in which the board is not found is no view.
    """
    rng = np.random.default_rng([seed, 2])
    told = reported(truth, rng, errors)
    views = list[CalibrationView]()
    for C, gripper in zip(truth.C, told, strict=True):
        with suppress(PerceptionError):
            found = sight(image(C, camera, rng), BOARD, LENS) if camera else exact(C, noise_px, rng)
            views.append(CalibrationView(sight=found, T_world_gripper=gripper))
    return views


def reported(truth: Cell, rng: np.random.Generator, errors: Errors) -> Float64[np.ndarray, "V 4 4"]:
    """The gripper's poses with the arm's errors in them. An outlier is off by 1 to 10 cm and 2 to 30 degrees."""
    told = truth.grippers.copy()
    count = len(told)
    told[:, :3, 3] += errors.joints_m * rng.standard_normal((count, 3))
    told[:, :3, :3] = told[:, :3, :3] @ exp(np.radians(errors.joints_deg) * rng.standard_normal((count, 3)))
    for index in rng.choice(count, round(errors.outliers * count), replace=False):
        told[index, :3, 3] += _direction(rng) * rng.uniform(0.01, 0.10)
        told[index, :3, :3] = told[index, :3, :3] @ exp(_direction(rng) * np.radians(rng.uniform(2, 30)))
    return told


def exact(C: Transform, noise_px: float, rng: np.random.Generator) -> BoardDetection:
    """Corners where the pinhole has them, with noise, and the true pose turned and shifted by what that noise does."""
    pixels = LENS.project(transform_points(C, BOARD.corners()))
    noisy = pixels + noise_px * rng.standard_normal(pixels.shape)
    turn, place = cv2.Rodrigues(C[:3, :3])[0], C[:3, 3].copy()
    _, turn, place = cv2.solvePnP(BOARD.corners(), noisy, LENS.K, np.zeros(5), turn, place, useExtrinsicGuess=True)
    T = transform(cv2.Rodrigues(turn)[0], np.ravel(place))
    return BoardDetection(ids=np.arange(BOARD.corner_count), pixels=noisy, T_camera_board=T, error_px=noise_px)


def image(C: Transform, camera: Camera, rng: np.random.Generator, lens: Lens = LENS) -> ColourImage:
    """Image of a board at `C` before a grey wall."""
    grey = _cast(C, lens) if lens.bend_px == 0 else _bent(C, lens)
    if camera.blur_px:
        grey = cv2.GaussianBlur(grey, (0, 0), camera.blur_px)
    across = (
        np.linspace(1.0, 1.0 - camera.shade, lens.width)
        * np.linspace(1.0, 1.0 - camera.shade / 2, lens.height)[:, None]
    )
    levels = grey * across + camera.noise * rng.standard_normal(grey.shape)
    return np.repeat(np.clip(levels, 0, 255).astype(np.uint8)[..., None], 3, axis=2)


def off(X: Transform, truth: Cell) -> tuple[float, float]:
    """Error of an estimated camera pose: [mm] and [degree]."""
    wrong = inverse(truth.X) @ X
    return 1e3 * float(np.linalg.norm(X[:3, 3] - truth.X[:3, 3])), float(
        np.degrees(np.linalg.norm(cv2.Rodrigues(wrong[:3, :3])[0]))
    )


@lru_cache(maxsize=4)
def _texture(board: Charuco) -> UInt8[np.ndarray, "h w"]:
    width, height = (round(side * _TEXTURE_PX_M) for side in board.size_m)
    return opencv_board(board).generateImage((width, height))


def _cast(C: Transform, lens: Lens) -> Float64[np.ndarray, "h w"]:
    """The board's texture by the homography from its plane to the image, several rays a pixel."""
    texture = _texture(BOARD)
    # A texture's pixel (0, 0) has its centre half a pixel inside the board.
    plane = np.diag([1 / _TEXTURE_PX_M, 1 / _TEXTURE_PX_M, 1.0])
    plane[:2, 2] = 0.5 / _TEXTURE_PX_M
    fine = np.array([[_FINE, 0, (_FINE - 1) / 2], [0, _FINE, (_FINE - 1) / 2], [0, 0, 1.0]])
    to_image = fine @ lens.K @ C[:3, [0, 1, 3]] @ plane
    size = (lens.width * _FINE, lens.height * _FINE)
    sharp = cv2.warpPerspective(texture, to_image, size, flags=cv2.INTER_LINEAR, borderValue=130)
    grey = cv2.resize(sharp, (lens.width, lens.height), interpolation=cv2.INTER_AREA)
    return 25.0 + 0.8 * grey.astype(np.float64)


def _bent(C: Transform, lens: Lens) -> Float64[np.ndarray, "h w"]:
    """The image through a lens that distorts: each pixel is that of the pinhole at its undistorted place."""
    u, v = np.meshgrid(np.arange(lens.width, dtype=float), np.arange(lens.height, dtype=float))
    ideal = lens.ideal(np.stack([u.ravel(), v.ravel()], axis=1)).reshape(lens.height, lens.width, 2)
    straight = _cast(C, Lens(width=lens.width, height=lens.height, K=lens.K))
    return cv2.remap(straight, ideal[..., 0].astype(np.float32), ideal[..., 1].astype(np.float32), cv2.INTER_CUBIC)


def _pose(rng: np.random.Generator, turn: list[float], place: list[float]) -> Transform:
    return transform(
        exp(np.array(turn) + 0.1 * rng.standard_normal(3)), np.array(place) + 0.02 * rng.standard_normal(3)
    )


def _before(rng: np.random.Generator, tilt_deg: float, distance_m: float) -> Transform:
    """A pose of the board in which the camera sees all of it."""
    middle = np.array([*BOARD.size_m, 0.0]) / 2
    while True:
        tilt = rng.uniform(-1, 1, 3) * np.radians([tilt_deg, tilt_deg, tilt_deg])
        R, depth = exp(tilt), distance_m * rng.uniform(0.85, 1.25)
        pixel = rng.uniform([180, 140], [460, 340])
        place = np.linalg.inv(LENS.K) @ [*pixel, 1.0] * depth - R @ middle
        C = transform(R, place)
        outline = LENS.project(transform_points(C, BOARD.outline()))
        if np.all((outline > 4) & (outline < [LENS.width - 5, LENS.height - 5])):
            return C


def _direction(rng: np.random.Generator) -> Float64[np.ndarray, "3"]:
    vector = rng.standard_normal(3)
    return vector / np.linalg.norm(vector)
