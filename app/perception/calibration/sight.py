"""Detection of a ChArUco board in one image: its corners, and its pose in the camera's frame."""

from dataclasses import dataclass
from functools import lru_cache
from typing import Any, TypeAlias, final

import cv2
import numpy as np
from jaxtyping import Float64, Int

from app.core.errors import PerceptionError
from app.core.geometry.charuco import DICTIONARIES, MARKERS, Charuco
from app.core.geometry.lens import Lens
from app.core.types import ColourImage, Transform
from app.perception.calibration.se3 import transform, transform_points

Pixels: TypeAlias = Float64[np.ndarray, "C 2"]
"""Column and row [pixel] of an ideal pinhole camera, counted from the centre of the top left pixel."""

FEWEST_CORNERS = 8
"""Fewest corners: a pose has six numbers, and the four corners of one square determine it badly."""
_ENOUGH_MARKERS = 4
"""Markers that are not mistaken for such by chance."""
_LEAST_CONTRAST = 25
"""Least contrast between the darkest and the lightest hundredth of an image, of 255; less is a lid, fog or a screen."""
_LARGEST_WINDOW_PX = 11
"""Largest half window of corner refinement, where the white about the markers leaves room: a marker in it costs 0.1
pixels and more."""
_WORST_PX = 3.0
"""Mean reprojection error above which the board is another one, bent, or moved during the exposure."""
_EDGE_ON = 0.17
"""Sine of 10 degrees, the flattest view of a board that is accepted."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class BoardDetection:
    """Detected corners, their numbers, and the board's best-fitting pose.

    `pixels` are undistorted, those of the ideal pinhole camera. `error_px`: root mean square reprojection error.
    """

    ids: Int[np.ndarray, " C"]
    pixels: Pixels
    T_camera_board: Transform
    error_px: float

    def points(self, board: Charuco) -> Float64[np.ndarray, "C 3"]:
        """Positions of the same corners on the board [m]."""
        return board.corners()[self.ids]


@lru_cache(maxsize=8)
def opencv_board(board: Charuco, *, legacy: bool = False) -> Any:
    """The board as an OpenCV object; `legacy`: in the layout of before OpenCV 4.6."""
    cells = DICTIONARIES[board.dictionary]
    family = getattr(cv2.aruco, f"DICT_{cells}X{cells}_{MARKERS}")
    markers = cv2.aruco.getPredefinedDictionary(family)
    pattern = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, markers)
    pattern.setLegacyPattern(legacy)
    return pattern


def sight(image: ColourImage, board: Charuco, lens: Lens) -> BoardDetection:
    """Detection of the board in `image`.

    Raises PerceptionError, with reason and remedy, where it is insufficient for a pose.
    """
    if image.shape[:2] != (lens.height, lens.width):
        raise PerceptionError(
            f"The image is {image.shape[1]} x {image.shape[0]} pixels and the camera's intrinsics are of "
            f"{lens.width} x {lens.height}; use the stream that was calibrated."
        )
    grey = cv2.cvtColor(np.ascontiguousarray(image), cv2.COLOR_RGB2GRAY)
    ids, raw = _corners(grey, board)
    pixels = lens.ideal(raw)
    return BoardDetection(ids=ids, pixels=pixels, **_pose(board.corners()[ids], pixels, lens))


def _corners(grey: np.ndarray, board: Charuco) -> tuple[Int[np.ndarray, " C"], Pixels]:
    dark, light = np.percentile(grey, (1, 99))
    found, numbers, _, marker_ids = _detector(board).detectBoard(grey)
    seen = 0 if marker_ids is None else len(marker_ids)
    if numbers is None and seen and board.rows % 2 == 0:
        found, numbers, _, _ = _detector(board, legacy=True).detectBoard(grey)
    count = 0 if numbers is None else len(numbers)
    if not count and light - dark < _LEAST_CONTRAST:
        raise PerceptionError("The image has no contrast; check light, exposure and whether the lens is covered.")
    if not count and seen >= _ENOUGH_MARKERS:
        raise PerceptionError(
            f"{seen} markers of the family {board.dictionary} are seen, but they do not lie as on the board of "
            f"{board}; give the numbers of columns and rows of the board that is in the image."
        )
    if not count:
        raise PerceptionError(
            f"The board is not in the image ({seen} of its markers are); show the board of {board}, flat, bright and "
            "whole, and check that it is the one that was printed."
        )
    if count < FEWEST_CORNERS:
        raise PerceptionError(
            f"{count} of the board's {board.corner_count} corners are seen and {FEWEST_CORNERS} are needed; bring all "
            "of it into the image, and keep hands and shadows off it."
        )
    ids, raw = np.asarray(numbers).reshape(-1).astype(np.int64), np.asarray(found, np.float32).reshape(-1, 1, 2)
    return ids, _refine_corners(grey, raw, _window_px(board, ids, raw[:, 0]))


@lru_cache(maxsize=8)
def _detector(board: Charuco, *, legacy: bool = False) -> Any:
    """OpenCV's detector; `legacy`: of a board with an even number of rows as OpenCV before 4.6 and calib.io lay it out.

    There its first square is white and carries a marker. The corners lie and count the same.
    """
    how = cv2.aruco.DetectorParameters()
    how.cornerRefinementMethod = cv2.aruco.CORNER_REFINE_SUBPIX
    pattern = opencv_board(board, legacy=legacy)
    return cv2.aruco.CharucoDetector(pattern, cv2.aruco.CharucoParameters(), how)


def _refine_corners(grey: np.ndarray, raw: np.ndarray, window_px: int) -> Pixels:
    """Corners refined to where image gradients are orthogonal to the vectors to them (Foerstner and Guelch 1987)."""
    stop = (cv2.TERM_CRITERIA_EPS + cv2.TERM_CRITERIA_MAX_ITER, 40, 1e-3)
    fine = cv2.cornerSubPix(grey, raw.copy(), (window_px, window_px), (-1, -1), stop)
    return fine.reshape(-1, 2).astype(np.float64)


def _window_px(board: Charuco, ids: Int[np.ndarray, " C"], raw: np.ndarray) -> int:
    """Half width of a window that contains no edges but those of the four squares about a corner: no marker's."""
    column, row = ids % (board.columns - 1), ids // (board.columns - 1)
    near = np.abs(column[:, None] - column) + np.abs(row[:, None] - row) == 1
    apart = np.linalg.norm(raw[:, None] - raw, axis=-1)
    side_px = float(apart[near].min()) if near.any() else 0.0
    white = (1 - board.marker_m / board.square_m) / 2
    return int(np.clip(white * side_px, 2, _LARGEST_WINDOW_PX))


def _pose(points: Float64[np.ndarray, "C 3"], pixels: Pixels, lens: Lens) -> dict[str, Any]:
    """`T_camera_board` and `error_px`: the better of a plane's two possible poses."""
    if np.linalg.matrix_rank(points[:, :2] - points[0, :2], tol=1e-6) < 2:
        raise PerceptionError("Only one row of the board's corners is seen; bring all of it into the image.")
    found, turns, places, _ = cv2.solvePnPGeneric(
        points, pixels, lens.K, np.zeros(5), flags=cv2.SOLVEPNP_IPPE, reprojectionError=np.zeros(2)
    )
    if not found:
        raise PerceptionError("The corners that were found fit no pose of the board; take another view.")
    best = min((_refit(points, pixels, lens, *each) for each in zip(turns, places, strict=True)), key=lambda it: it[1])
    T_camera_board, error_px = best
    if error_px > _WORST_PX:
        raise PerceptionError(
            f"The corners miss every pose of the board by {error_px:.1f} pixels; hold still, keep the board flat, and "
            f"check that its squares measure {_side_mm(points):g} mm."
        )
    _check_flat(T_camera_board, points)
    return {"T_camera_board": T_camera_board, "error_px": error_px}


def _side_mm(points: Float64[np.ndarray, "C 3"]) -> float:
    apart = np.linalg.norm(points[:, None] - points, axis=-1)
    return round(1e3 * float(apart[apart > 0].min()), 3)


def _refit(
    points: Float64[np.ndarray, "C 3"], pixels: Pixels, lens: Lens, turn: np.ndarray, place: np.ndarray
) -> tuple[Transform, float]:
    turn, place = cv2.solvePnPRefineLM(points, pixels, lens.K, np.zeros(5), turn.copy(), place.copy())
    T = transform(cv2.Rodrigues(turn)[0], place[:, 0])
    if not np.all(np.isfinite(T)) or np.any(transform_points(T, points)[:, 2] <= 0):
        return T, float("inf")
    off = lens.project(transform_points(T, points)) - pixels
    return T, float(np.sqrt(np.mean(np.sum(off**2, axis=1))))


def _check_flat(T_camera_board: Transform, points: Float64[np.ndarray, "C 3"]) -> None:
    middle = transform_points(T_camera_board, points).mean(axis=0)
    if abs(T_camera_board[:3, 2] @ middle) / np.linalg.norm(middle) < _EDGE_ON:
        raise PerceptionError("The board is seen almost edge on; turn it more towards the camera.")
