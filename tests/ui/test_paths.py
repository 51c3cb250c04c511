"""The lines and colours of the picture."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.core.motion import TOOL_DOWN, Motion
from app.ui.parts import palette
from app.ui.view.paths import along, segments

MOTION = Motion(positions=np.array([[0.0, 0, 0], [0.3, 0, 0], [0.3, 0.2, 0]]), speeds=np.array([0.1, 0.1, 0.2]))


@pytest.mark.parametrize(
    ("elapsed_s", "position"),
    [(0.0, (0, 0, 0)), (1.5, (0.15, 0, 0)), (3.0, (0.3, 0, 0)), (3.5, (0.3, 0.1, 0)), (4.0, (0.3, 0.2, 0))],
)
def test_the_ghost_makes_the_motion_at_the_speed_of_the_arm(elapsed_s, position):
    np.testing.assert_allclose(along(MOTION, elapsed_s)[:3], position, atol=1e-12)


def test_the_ghost_rests_at_the_end_and_starts_again():
    np.testing.assert_allclose(along(MOTION, 4.5)[:3], MOTION.positions[-1])
    np.testing.assert_allclose(along(MOTION, 4.8 + 1.5)[:3], [0.15, 0, 0], atol=1e-12)


def test_a_motion_of_one_point_stays_there():
    still = Motion(positions=np.ones((1, 3)), speeds=np.ones(1))
    np.testing.assert_allclose(along(still, 7.0)[:3], np.ones(3))


def test_non_finite_pieces_of_a_path_are_left_out():
    path = np.array([[0, 0, 0], [1, 0, 0], [np.nan, 0, 0], [3, 0, 0], [4, 0, 0]], dtype=float)
    assert segments(path)[:, :, 0].tolist() == [[0, 1], [3, 4]]
    assert segments(path[:1]).shape == (0, 2, 3)


def test_colours_go_by_rank_so_that_one_outlier_does_not_hide_the_others():
    near, far = palette.by_cost(np.array([1.0, 2.0, 3.0])), palette.by_cost(np.array([1.0, 2.0, 3e9]))
    np.testing.assert_array_equal(near, far)
    np.testing.assert_array_equal(near[[0, 2]], [palette.CHEAP, palette.DEAR])


def test_a_turn_in_place_takes_the_time_that_the_arm_takes_for_it() -> None:
    turned = Rotation.from_rotvec([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]]) * Rotation.from_quat(TOOL_DOWN, scalar_first=True)
    pour = Motion(positions=np.ones((2, 3)), speeds=np.full(2, 0.05), turns=turned.as_quat(scalar_first=True))
    halfway = Rotation.from_quat(along(pour, 1.0)[3:7], scalar_first=True)
    assert (turned[0].inv() * halfway).magnitude() == pytest.approx(0.5, abs=0.03)
