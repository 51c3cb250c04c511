"""A timed way becomes a motion that an arm makes in the same time, at the same places."""

from collections.abc import Callable

import numpy as np
import pytest

from app.arm.gate import check_motion
from app.arm.path import SCALE
from app.arm.timed_motion import made_track, motion_along
from app.config import Site
from app.core.errors import PlanningError
from app.core.geometry.track import Track
from app.policy.random_carries import carry_design, random_carry
from app.policy.random_pours import beside, random_pour
from app.sim.effects.base import MIDDLE_M

SITE = Site()


def carry(seed: int) -> Track:
    start = np.array([0.5, -0.2, 0.12, 0.0, 1.0, 0.0, 0.0, 0.004])
    design = carry_design(1, 1)
    return random_carry(np.random.default_rng(seed), start, design, start_s=7.0, closed_m=0.004)


def pour(seed: int) -> Track:
    start = np.array([*beside(MIDDLE_M, 2.0), 0.2])
    motion = random_pour(np.random.default_rng(seed), start, MIDDLE_M, volume_m3=1.2e-4, radius_m=0.06)
    return motion.track(start_s=3.0)


def padded(track: Track, count: int) -> np.ndarray:
    """Scaled poses at so many even times, with openings."""
    poses = track.poses_at(np.linspace(track.times_s[0], track.end_s, count))
    return np.concatenate([poses, np.zeros((count, 8 - poses.shape[1]))], axis=1) * SCALE


def test_a_tool_that_is_a_little_beside_the_first_pose_is_there_at_once() -> None:
    motion = motion_along(pour(1), SITE)
    beside_it = motion.poses[0] + np.array([1e-3, 0.0, 0.0, *[0.0] * 4, 2e-3])
    late_s = made_track(beside_it, motion, SITE).end_s - made_track(motion.poses[0], motion, SITE).end_s
    assert late_s < 0.3


@pytest.mark.parametrize("make", [carry, pour])
@pytest.mark.parametrize("seed", range(4))
def test_an_arm_makes_the_way_at_its_places_and_about_as_fast(make: Callable[[int], Track], seed: int) -> None:
    wanted = make(seed)
    motion = motion_along(wanted, SITE)
    check_motion(motion, motion.digest(), SITE)
    assert motion.continues
    made = made_track(motion.poses[0], motion, SITE)
    way, reference = padded(made, 400), padded(wanted, 4000)
    apart = np.linalg.norm(way[:, None] - reference[None], axis=2)
    assert apart.min(1).max() < 0.003
    assert apart.min(0).max() < 0.003
    np.testing.assert_allclose(way[[0, -1]], reference[[0, -1]], atol=1e-3)
    span_s = wanted.end_s - wanted.times_s[0]
    assert 0.9 * span_s < made.end_s < 1.2 * span_s
    speeds = np.linalg.norm(np.diff(made.positions, axis=0), axis=1) / np.diff(made.times_s)
    assert speeds.max() <= SITE.limits.speed_m_s * 1.01


def test_where_the_site_allows_its_speed_it_lasts_as_long() -> None:
    wanted = pour(1)
    slow = Track(times_s=4 * wanted.times_s, poses=wanted.poses)
    motion = motion_along(slow, SITE)
    made = made_track(motion.poses[0], motion, SITE)
    assert made.end_s == pytest.approx(slow.end_s - slow.times_s[0], rel=0.1)


def test_a_rest_on_the_way_is_kept_by_a_nod_of_a_millimetre() -> None:
    pose = np.array([0.5, 0.0, 0.1, 0.0, 1.0, 0.0, 0.0])
    there, further = pose + np.array([0.1, *[0.0] * 6]), pose + np.array([0.1, 0.1, *[0.0] * 5])
    rested = Track(times_s=np.array([0.0, 1.0, 2.5, 3.5]), poses=np.stack([pose, there, there, further]))
    made = made_track(np.append(pose, 0.0), motion_along(rested, SITE), SITE)
    beside_it = np.linalg.norm(made.positions - there[:3], axis=1) < 0.0015
    assert 1.3 < 0.01 * beside_it.sum() < 1.8
    assert made.positions[:, 2].max() == pytest.approx(0.101, abs=1e-4)


def test_a_track_that_stands_still_is_no_motion() -> None:
    pose = np.array([0.5, 0.0, 0.1, 0.0, 1.0, 0.0, 0.0])
    with pytest.raises(PlanningError, match="stands still"):
        motion_along(Track(times_s=np.array([0.0, 1.0]), poses=np.stack([pose, pose])), SITE)
