"""Check of a camera's factory intrinsics against a fit to views of a board (Zhang 2000)."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import cv2
import numpy as np
from jaxtyping import Float64

from app.core.errors import PerceptionError
from app.core.geometry.charuco import Charuco
from app.core.geometry.hand_eye import Agreement
from app.core.geometry.lens import STRAIGHT, Distortion, Lens
from app.perception.calibration.sight import BoardDetection

FEWEST_SIGHTS = 6
_LEAST_TILT_DEG = 8.0
"""Least root mean square of tilts about their mean: boards that all face the camera do not determine its focal
length."""
_SURE = 3.0
"""Standard deviations from which a difference is significant."""
_MATTERS_SHARE, _MATTERS_PX = 0.004, 4.0
"""Relevant differences of the focal length (3 mm at 0.7 m) and of the principal point (as much aside); smaller ones
are ignored."""
_BEND_PX = 0.7
"""Distortion at the corners' pixels that deserves a note."""
_POOR_PX = 0.6
"""Reprojection error above which corners are not to blame: the board is bent, or the images are blurred."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class LensCheck:
    """The factory intrinsics beside the best fit.

    `told` and `fitted`: fx, fy, cx, cy [pixel]; `deviation`: standard deviations of `fitted`. `told_px`, `fitted_px`
    and `bent_px`: reprojection errors with the factory values, with the fitted ones, and with two more parameters of
    radial distortion, which move pixels of the seen corners by up to `bend_px` beyond the factory model.
    """

    sights: int
    told: Float64[np.ndarray, "4"]
    fitted: Float64[np.ndarray, "4"]
    deviation: Float64[np.ndarray, "4"]
    told_px: float
    fitted_px: float
    bent_px: float
    bend_px: float

    @property
    def verdict(self) -> Agreement:
        """A relevant difference, none, or open where the views could not show one."""
        matters = np.array([_MATTERS_SHARE] * 2 + [0.0] * 2) * self.told + [0.0, 0.0, _MATTERS_PX, _MATTERS_PX]
        apart = np.abs(self.fitted - self.told)
        if np.any((apart > matters) & (apart > _SURE * self.deviation)) or self._bends:
            return "differs"
        return "open" if np.any(_SURE * self.deviation > 2 * matters) or self.fitted_px > _POOR_PX else "agrees"

    @property
    def _bends(self) -> bool:
        return self.bend_px > _BEND_PX and self.bent_px < 0.8 * self.fitted_px

    def __str__(self) -> str:
        """The verdict in words, with its consequence."""
        if self.verdict == "agrees":
            return f"The maker's intrinsics agree with {self.sights} views of the board; use them."
        if self._bends:
            return (
                f"The image is bent by up to {self.bend_px:.1f} pixels beyond what the maker says; give the lens's "
                "distortion, or let the camera's driver rectify the stream."
            )
        if self.verdict == "differs":
            return (
                "The maker's intrinsics do not fit these views: check that they are of this stream's resolution and "
                "that the squares measure what the board says; else calibrate the camera with its maker's tool."
            )
        if self.fitted_px > _POOR_PX:
            return f"Nothing fits within {self.fitted_px:.1f} pixels: flatten the board, hold it still, add light."
        return "These views leave the intrinsics open; bring the board into the image's corners, near, and tilted."


def check_lens(sights: Sequence[BoardDetection], board: Charuco, lens: Lens) -> LensCheck:
    """Compare both. Raises PerceptionError where the views are too few or too similar."""
    _check_enough(sights)
    told_px = float(np.sqrt(np.mean([sight.error_px**2 for sight in sights])))
    fitted_px, K, _, deviation = _fit(sights, board, lens, radial=False)
    bent_px, K_bent, bent, _ = _fit(sights, board, lens, radial=True)
    seen = np.concatenate([sight.pixels for sight in sights])
    moves = Lens(width=lens.width, height=lens.height, K=K_bent, distortion=bent).ideal(seen) - seen
    return LensCheck(
        sights=len(sights),
        told=_numbers(lens.K),
        fitted=_numbers(K),
        deviation=deviation,
        told_px=told_px,
        fitted_px=fitted_px,
        bent_px=bent_px,
        bend_px=float(np.linalg.norm(moves, axis=1).max()),
    )


def _check_enough(sights: Sequence[BoardDetection]) -> None:
    if len(sights) < FEWEST_SIGHTS:
        raise PerceptionError(
            f"{len(sights)} views show the board and {FEWEST_SIGHTS} are needed at least; take 10 to 20, tilted, near "
            "and far, in all corners of the image."
        )
    normals = np.array([sight.T_camera_board[:3, 2] for sight in sights])
    middle = normals.mean(axis=0) / np.linalg.norm(normals.mean(axis=0))
    tilt_deg = float(np.degrees(np.sqrt(np.mean(np.arccos(np.clip(normals @ middle, -1, 1)) ** 2))))
    if tilt_deg < _LEAST_TILT_DEG:
        raise PerceptionError(
            f"The board is tilted by {tilt_deg:.0f} degrees from view to view, which leaves the focal length open; "
            "tilt it by 20 to 40 degrees to all sides."
        )


def _fit(
    sights: Sequence[BoardDetection], board: Charuco, lens: Lens, *, radial: bool
) -> tuple[float, Float64[np.ndarray, "3 3"], Distortion, Float64[np.ndarray, "4"]]:
    """Reprojection error [pixel], K, distortion, and the standard deviations of fx, fy, cx, cy."""
    flags = cv2.CALIB_USE_INTRINSIC_GUESS | cv2.CALIB_ZERO_TANGENT_DIST | cv2.CALIB_FIX_K3
    flags |= 0 if radial else cv2.CALIB_FIX_K1 | cv2.CALIB_FIX_K2
    points = [sight.points(board).astype(np.float32) for sight in sights]
    pixels = [sight.pixels.astype(np.float32) for sight in sights]
    error_px, K, bent, _, _, deviation, _, _ = cv2.calibrateCameraExtended(
        points, pixels, (lens.width, lens.height), lens.K.copy(), np.array(STRAIGHT), flags=flags
    )
    k1, k2, p1, p2, k3 = (float(number) for number in np.ravel(bent)[:5])
    return float(error_px), np.asarray(K, np.float64), (k1, k2, p1, p2, k3), np.ravel(deviation)[:4].astype(np.float64)


def _numbers(K: Float64[np.ndarray, "3 3"]) -> Float64[np.ndarray, "4"]:
    return np.array([K[0, 0], K[1, 1], K[0, 2], K[1, 2]])
