"""Detection in rendered images: how exact, and what is said where there is nothing to detect."""

from dataclasses import replace

import cv2
import numpy as np
import pytest

from app.core.errors import ParameterError, PerceptionError, UsageError
from app.core.geometry.charuco import Charuco
from app.core.geometry.lens import Lens
from app.perception.calibration.se3 import transform_points
from app.perception.calibration.sight import sight
from bench.boards import BOARD, LENS, Camera, cell, image

BENT = replace(LENS, distortion=(-0.12, 0.05, 0.001, -0.001, 0.0))


def view(seed: int, lens: Lens = LENS, camera: Camera | None = None):
    """An image, and where its corners are by the pinhole."""
    pose = cell(seed, 1).C[0]
    taken = image(pose, camera or Camera(), np.random.default_rng(seed), lens)
    return taken, pose, LENS.project(transform_points(pose, BOARD.corners()))


@pytest.mark.parametrize("lens", [LENS, BENT], ids=["straight", "bent"])
def test_corners_are_found_to_a_tenth_of_a_pixel_and_the_pose_to_a_millimetre(lens):
    for seed in range(4):
        taken, pose, corners = view(seed, lens)
        found = sight(taken, BOARD, lens)
        assert len(found.ids) == BOARD.corner_count
        assert np.sqrt(np.mean((found.pixels - corners[found.ids]) ** 2)) < 0.1
        middle = np.array([[*BOARD.size_m, 0.0]]) / 2
        assert np.linalg.norm(transform_points(found.T_camera_board, middle) - transform_points(pose, middle)) < 2e-3
        assert np.degrees(np.arccos(found.T_camera_board[:3, 2] @ pose[:3, 2])) < 0.5
        assert found.error_px < 0.4


def test_a_board_that_is_half_covered_is_still_placed():
    taken, pose, _ = view(0)
    column = int(LENS.project(pose[:3, 3] + pose[:3, :3] @ [BOARD.size_m[0] / 2, 0, 0])[0])
    taken[:, column:] = 90
    found = sight(taken, BOARD, LENS)
    assert 8 <= len(found.ids) < BOARD.corner_count
    np.testing.assert_allclose(found.T_camera_board[:3, 3], pose[:3, 3], atol=4e-3)


def test_what_cannot_be_used_is_refused_in_words():
    taken, pose, _ = view(0)
    rng = np.random.default_rng(0)
    corner = taken.copy()
    for left, top in ((3.4, -1.0), (-1.0, 2.6)):
        quad = np.array([[left, top], [9.0, top], [9.0, 9.0], [left, 9.0]]) * BOARD.square_m
        pixels = LENS.project(transform_points(pose, np.column_stack([quad, np.zeros(4)])))
        cv2.fillConvexPoly(corner, pixels.astype(np.int32), (90, 90, 90))
    hostile = {
        "no contrast": np.full_like(taken, 128),
        "not in the image": rng.integers(0, 255, taken.shape, np.uint8),
        "of the board's 24 corners are seen": corner,
        "use the stream that was calibrated": taken[::2, ::2],
    }
    for said, each in hostile.items():
        with pytest.raises(PerceptionError, match=said):
            sight(each, BOARD, LENS)


def test_another_board_and_one_in_a_mirror_are_not_taken_for_this_one():
    taken, _, _ = view(0)
    with pytest.raises(PerceptionError):
        sight(np.ascontiguousarray(taken[:, ::-1]), BOARD, LENS)
    with pytest.raises(PerceptionError):
        sight(taken, replace(BOARD, dictionary="6x6"), LENS)


def test_another_lens_than_the_image_s_is_noticed():
    taken, _, _ = view(1, replace(LENS, distortion=(-0.6, 0.0, 0.0, 0.0, 0.0)))
    straight, _, _ = view(1)
    assert sight(taken, BOARD, LENS).error_px > 4 * sight(straight, BOARD, LENS).error_px


@pytest.mark.parametrize(
    ("wrong", "error"),
    [
        ({"columns": 1}, ParameterError),
        ({"square_m": float("nan")}, ParameterError),
        ({"marker_m": 0.036}, ParameterError),
        ({"columns": 12, "rows": 12}, ParameterError),
        ({"dictionary": "8x8"}, UsageError),
    ],
)
def test_numbers_that_make_no_board_are_refused(wrong, error):
    with pytest.raises(error):
        Charuco(**wrong)


def printed(board: Charuco, *, legacy: bool) -> np.ndarray:
    """The board flat in the image, in OpenCV's layout of today or of before 4.6."""
    family = cv2.aruco.getPredefinedDictionary(cv2.aruco.DICT_4X4_50)
    pattern = cv2.aruco.CharucoBoard((board.columns, board.rows), board.square_m, board.marker_m, family)
    pattern.setLegacyPattern(legacy)
    width, height = board.columns * 60, board.rows * 60
    grey = np.full((480, 640), 130, np.uint8)
    y, x = (480 - height) // 2, (640 - width) // 2
    grey[y : y + height, x : x + width] = pattern.generateImage((width, height))
    return np.repeat(cv2.GaussianBlur(grey, (0, 0), 0.7)[..., None], 3, axis=2)


def test_a_board_of_even_rows_is_found_in_the_layout_of_today_and_of_before_opencv_4_6():
    board = Charuco(columns=8, rows=6)
    found, older = (sight(printed(board, legacy=legacy), board, LENS) for legacy in (False, True))
    assert len(found.ids) == len(older.ids) == board.corner_count
    assert max(found.error_px, older.error_px) < 0.3
    np.testing.assert_allclose(older.T_camera_board, found.T_camera_board, atol=2e-3)


def test_markers_of_a_board_of_other_numbers_are_told_to_be_such():
    with pytest.raises(PerceptionError, match="do not lie as on the board"):
        sight(printed(Charuco(columns=8, rows=6), legacy=False), Charuco(columns=5, rows=9), LENS)
