"""Random carries: within their box, smooth, and closed once the cloth is taken."""

from itertools import pairwise

import numpy as np
import pytest

from app.core.geometry.track import Track
from app.policy.random_carries import HIGH_M, LOW_M, carry_design, random_carry, random_grasp

PLAN = carry_design(2, 3)
CLOSED_M, OPEN_M = 0.004, 0.040
EDGE = np.array([[0.45 + 0.01 * k, -0.05, 0.002] for k in range(20)] + [[0.45, -0.30, 0.002]], np.float32)


def carries(seed: int, count: int = 4) -> list[Track]:
    """The first takes the cloth at its edge; each other begins where the one before it ended."""
    rng = np.random.default_rng(seed)
    start = random_grasp(rng, EDGE, height_m=0.006, opening_m=OPEN_M)
    made = list[Track]()
    for number in range(count):
        made.append(random_carry(rng, start, PLAN, start_s=8.0 * number, closed_m=CLOSED_M))
        start = made[-1].poses[-1]
    return made


@pytest.mark.parametrize("seed", range(5))
def test_a_carry_goes_on_where_the_last_one_ended_and_ends_within_its_box(seed: int) -> None:
    made = carries(seed)
    for before, after in pairwise(made):
        assert after.poses[0] == pytest.approx(before.poses[-1], abs=1e-12)
    for number, track in enumerate(made):
        assert track.poses.shape[1] == 8
        assert np.diff(track.times_s) == pytest.approx(np.full(len(track.times_s) - 1, 0.02))
        assert 1.2 < track.end_s - 8.0 * number < 3.0
        assert np.all(track.positions[-1] >= LOW_M)
        assert np.all(track.positions[-1] <= HIGH_M)


@pytest.mark.parametrize("seed", range(5))
def test_the_gripper_closes_at_the_edge_before_it_moves_and_stays_closed(seed: int) -> None:
    first, *others = carries(seed)
    near = np.linalg.norm(EDGE[:, :2] - first.positions[0, :2], axis=1).min()
    assert near < 0.0125
    assert first.poses[0, 7] == OPEN_M
    moving = np.linalg.norm(np.diff(first.positions, axis=0), axis=1) > 1e-9
    assert np.all(first.poses[1:, 7][moving] == CLOSED_M)
    assert first.positions[-1, 2] > 0.02
    for track in others:
        assert np.all(track.poses[:, 7] == CLOSED_M)


@pytest.mark.parametrize("seed", range(5))
def test_a_carry_turns_about_the_vertical_alone_and_is_slow_enough_for_an_arm(seed: int) -> None:
    made = carries(seed)
    turns = np.concatenate([track.poses[:, 3:7] for track in made])
    assert np.linalg.norm(turns, axis=1) == pytest.approx(1.0)
    assert np.abs(turns[:, [0, 3]]).max() == 0.0
    assert np.ptp(2 * np.arctan2(turns[:, 2], turns[:, 1])) > 0.1
    speeds = np.concatenate([np.linalg.norm(np.diff(track.positions, axis=0), axis=1) / 0.02 for track in made])
    assert speeds.max() < 1.0


def test_the_same_seed_draws_the_same_carry() -> None:
    assert np.array_equal(carries(3)[1].poses, carries(3)[1].poses)
    assert not np.array_equal(carries(3)[0].poses[0], carries(4)[0].poses[0])
