"""Progress along a path is told by where the tool was measured, whatever clock the arm goes by."""

import numpy as np
import pytest
from hypothesis import Phase, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.arm.path import PathFollower
from app.core.motion import pointing_down
from app.rig.kinova.path_progress import Along

FAST_M, TICK_S, ACCELERATION_M_S2, NEAR_M = 0.01, 0.01, 1.0, 1.1e-3
places = st.tuples(st.floats(0.3, 0.8), st.floats(-0.3, 0.3), st.floats(0.01, 0.3))
paths = st.lists(places, min_size=2, max_size=6, unique=True).filter(
    lambda path: min(np.linalg.norm(np.diff(np.array(path), axis=0), axis=1)) > 0.01
)


def poses(*places: tuple[float, float, float]) -> np.ndarray:
    return np.array([pointing_down(np.array(place)) for place in places])


def gone(points: np.ndarray, speed: float = 0.25) -> list[np.ndarray]:
    """Places at every tick of a tool that goes along the path by a clock of its own."""
    follower, at = PathFollower(points, np.full(len(points) - 1, speed), ACCELERATION_M_S2), [points[0]]
    while not follower.at_rest:
        at.append(follower.advance(TICK_S))
    return at


@settings(max_examples=25, phases=[Phase.generate])
@given(path=paths, speed=st.floats(0.05, 0.3))
def test_a_tool_is_found_where_it_is_on_any_way_that_it_goes_along(
    path: list[tuple[float, float, float]], speed: float
) -> None:
    points = poses(*path)
    along = Along(points)
    for tool in gone(points, speed):
        assert along.advance(tool, FAST_M)[:3] == pytest.approx(tool[:3], abs=NEAR_M)
        assert along.off_m < NEAR_M


@settings(max_examples=25, phases=[Phase.generate])
@given(path=paths, late=st.integers(2, 40))
def test_who_looks_late_knows_as_well_how_far_beside_its_way_a_tool_is(
    path: list[tuple[float, float, float]], late: int
) -> None:
    """Progress falls behind meanwhile, as a late process's tick advances no farther than others."""
    along = Along(poses(*path))
    for tool in gone(poses(*path), 0.25)[::late]:
        along.advance(tool, FAST_M / 4, 0.25 * late * TICK_S)
        assert along.off_m < NEAR_M


@pytest.mark.parametrize("turns_at", [0.499, 0.5, 0.501])
def test_on_a_way_to_and_fro_the_way_back_is_not_taken_for_the_way_there(turns_at: float) -> None:
    along, points = Along(poses((0.4, 0, 0.1), (0.5, 0, 0.1), (0.4, 0, 0.1))), poses((0.48, 0, 0.1), (0.49, 0, 0.1))
    for tool in points:
        assert along.advance(tool, 1.0)[:3] == pytest.approx(tool[:3])
    # It may turn a little before the corner, or beyond it.
    along.advance(poses((turns_at, 0, 0.1))[0], 1.0)
    for tool in points[::-1]:
        assert along.advance(tool, 1.0)[:3] == pytest.approx(tool[:3], abs=NEAR_M)


def test_it_comes_no_further_than_it_may_and_never_back() -> None:
    along, end = Along(poses((0.4, 0, 0.1), (0.5, 0, 0.1))), poses((0.5, 0, 0.1))[0]
    found = [float(along.advance(end, 0.002)[0]) for _ in range(100)]
    assert np.diff([0.4, *found]).max() <= 0.002 + 1e-9
    assert found[-1] == pytest.approx(0.5)
    assert along.advance(poses((0.42, 0, 0.1))[0], 0.002)[0] == pytest.approx(0.5)


def test_a_tool_beside_its_way_is_seen_to_be() -> None:
    along = Along(poses((0.4, 0, 0.1), (0.5, 0, 0.1), (0.5, 0.1, 0.1)))
    along.advance(poses((0.45, 0.02, 0.1))[0], 1.0)
    assert along.off_m == pytest.approx(0.02)


def test_a_turn_on_the_spot_is_a_way_and_fingers_are_none() -> None:
    points = poses(*[(0.4, 0, 0.1)] * 3, (0.5, 0, 0.1))
    turned = Rotation.from_euler("z", 90, degrees=True) * Rotation.from_quat(points[0, 3:7], scalar_first=True)
    points[1:, 3:7] = turned.as_quat(scalar_first=True)
    points[:2, 7], points[2:, 7] = 0.085, 0.0
    along = Along(points)
    half = Rotation.from_euler("z", 45, degrees=True) * Rotation.from_quat(points[0, 3:7], scalar_first=True)
    tool = np.array([0.4, 0, 0.1, *-half.as_quat(scalar_first=True), 0.085])
    found = Rotation.from_quat(along.advance(tool, 1.0)[3:7], scalar_first=True)
    assert np.degrees((found.inv() * half).magnitude()) < 1.0
    along.advance(points[1], 1.0)
    # It holds something, so its fingers never close; it goes on all the same.
    held = np.array([0.43, 0, 0.1, *points[1, 3:7], 0.06])
    assert along.advance(held, 1.0)[:3] == pytest.approx(held[:3])
