"""Along any path the arm keeps its limits, comes to rest at the end, and brakes where it is told to."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arm.path import PathFollower, route
from app.config import Site
from app.core.motion import Motion, pointing_down

TICK_S, ACCELERATION = 0.01, 1.5
CORNER_JUMP_M_S = 0.06

coordinates = st.floats(-0.3, 0.3)
places = st.tuples(st.floats(0.3, 0.8), coordinates, st.floats(0.01, 0.3))
paths = st.lists(places, min_size=2, max_size=5, unique=True).filter(
    lambda path: min(np.linalg.norm(np.diff(np.array(path), axis=0), axis=1)) > 0.002
)


def run(points: np.ndarray, speeds: np.ndarray) -> np.ndarray:
    """Places of the follower at every tick, from the start on; `points` are places of a tool that points down."""
    follower, seen = PathFollower(poses(points), speeds, ACCELERATION), [points[0]]
    while not follower.at_rest:
        seen.append(follower.advance(TICK_S)[:3])
        assert len(seen) < 10_000
    return np.array(seen)


def poses(points: np.ndarray) -> np.ndarray:
    return np.array([pointing_down(point) for point in points])


@settings(max_examples=15)
@given(path=paths, speed=st.floats(0.1, 0.3))
def test_any_path_is_followed_to_its_end_within_its_limits(
    path: list[tuple[float, float, float]], speed: float
) -> None:
    points = np.array(path)
    seen = run(points, np.full(len(points) - 1, speed))
    velocity = np.diff(seen, axis=0, prepend=seen[:1], append=seen[-1:]) / TICK_S
    assert np.array_equal(seen[-1], points[-1])
    assert np.linalg.norm(velocity, axis=1).max() <= speed * (1 + 1e-9)
    jumps = np.linalg.norm(np.diff(velocity, axis=0), axis=1)
    # Two nodes may fall into one tick, and the last tick may end anywhere in its period.
    assert jumps.max() <= 2 * ACCELERATION * TICK_S + 2 * CORNER_JUMP_M_S


def test_on_a_straight_line_the_acceleration_limit_holds_at_every_tick() -> None:
    seen = run(np.array([[0.3, 0, 0.1], [0.7, 0.1, 0.1]]), np.array([0.3]))
    velocity = np.diff(seen, axis=0) / TICK_S
    change = np.linalg.norm(np.diff(velocity, axis=0), axis=1) / TICK_S
    assert change[:-3].max() <= ACCELERATION * (1 + 1e-6)
    # The end of the path lies anywhere within the last tick.
    assert change.max() <= 1.25 * ACCELERATION


def test_each_segment_is_run_at_its_own_speed() -> None:
    points = np.array([[0.3, 0, 0.1], [0.5, 0, 0.1], [0.7, 0, 0.1]])
    seen = run(points, np.array([0.3, 0.1]))
    speed, x = np.linalg.norm(np.diff(seen, axis=0), axis=1) / TICK_S, seen[1:, 0]
    assert np.isclose(speed[(x > 0.35) & (x < 0.45)].max(), 0.3)
    assert np.isclose(speed[(x > 0.51) & (x < 0.68)].max(), 0.1)


@given(ticks=st.integers(1, 120))
@settings(max_examples=30)
def test_braking_comes_to_rest_on_the_path_within_the_stopping_distance(ticks: int) -> None:
    points = np.array([[0.3, 0, 0.1], [0.5, 0, 0.1], [0.5, 0.2, 0.1]])
    follower, deceleration = PathFollower(poses(points), np.array([0.3, 0.3]), ACCELERATION), 6.0
    before = poses(points)[0]
    for _ in range(ticks):
        before = follower.advance(TICK_S)
    follower.brake(deceleration)
    seen = [before]
    while not follower.at_rest:
        seen.append(follower.advance(TICK_S))
    assert len(seen) <= 0.3 / deceleration / TICK_S + 2
    assert np.linalg.norm(np.diff(seen, axis=0), axis=1).sum() <= 0.3**2 / (2 * deceleration) + 0.3 * TICK_S
    assert np.array_equal(follower.advance(TICK_S), seen[-1])


def test_the_way_to_a_motion_goes_over_the_table_at_travel_height() -> None:
    site = Site()
    motion = Motion(positions=np.array([[0.5, 0.1, 0.01], [0.6, 0.1, 0.01]]), speeds=np.array([0.1, 0.2]))
    points, speeds = route(pointing_down(np.array([0.4, -0.1, 0.02])), motion, site)
    low = points[:, 2] < site.travel_height_m
    assert np.array_equal(points[low][1:, :3], motion.positions)
    assert np.allclose(np.diff(points[:2], axis=0)[0, :2], 0.0), "it first goes straight up"
    assert points[-1, 2] == site.travel_height_m
    assert np.array_equal(speeds[2:4], motion.speeds)


TURN = np.array([0.0, np.cos(0.4), np.sin(0.4), 0.0])


def test_a_motion_that_continues_goes_along_its_own_way_alone_and_turns_and_opens_on_it() -> None:
    start = pointing_down(np.array([0.4, 0.0, 0.2]))
    positions = np.array([[0.4, 0.0, 0.2], [0.4, 0.0, 0.2], [0.45, 0.0, 0.2]])
    turns = np.array([start[3:7], TURN, -TURN])
    motion = Motion(
        positions=positions, speeds=np.full(3, 0.1), turns=turns, openings=np.array([0.0, 0.04, 0.04]), continues=True
    )
    points, speeds = route(start, motion, Site())
    assert len(points) == 3, "the start is the first position"
    follower, seen = PathFollower(points, speeds, ACCELERATION), [points[0]]
    while not follower.at_rest:
        seen.append(follower.advance(TICK_S))
    way = np.array(seen)
    np.testing.assert_allclose(np.linalg.norm(way[:, 3:7], axis=1), 1.0, atol=1e-12)
    np.testing.assert_allclose(way[-1], [0.45, 0.0, 0.2, *TURN, 0.04], atol=1e-9)
    turned = 2 * np.arccos(np.clip(np.abs((way[1:, 3:7] * way[:-1, 3:7]).sum(1)), 0, 1))
    assert turned.sum() == pytest.approx(0.8, abs=1e-3), "the shorter way round, and not back"
    assert (0.1 * turned / TICK_S).max() <= 0.1 * (1 + 1e-2), "a turn counts as the way of a point 10 cm away"
