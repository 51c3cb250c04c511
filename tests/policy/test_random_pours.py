"""Random motions of a held bowl: from rest beside a fixed one, tilted over it, and to rest beside it again."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.policy.random_pours import ASIDE_M, PourMotion, beside, random_pour

AROUND, RADIUS_M, HEIGHT_M = (0.55, 0.0), 0.055, 0.144


def drawn(seed: int, volume_m3: float = 120e-6) -> PourMotion:
    start = np.array([*beside(AROUND, 0.7 * seed), HEIGHT_M])
    return random_pour(np.random.default_rng(seed), start, AROUND, volume_m3=volume_m3, radius_m=RADIUS_M)


def axes(poses: np.ndarray) -> np.ndarray:
    """The bowl's axis, up where it is upright."""
    return -Rotation.from_quat(poses[:, 3:], scalar_first=True).as_matrix()[:, :, 2]


@pytest.mark.parametrize("seed", range(6))
def test_it_begins_and_ends_upright_beside_the_bowl_and_leans_towards_it_between(seed: int) -> None:
    motion = drawn(seed)
    track = motion.track(start_s=10.0)
    up, ends = axes(track.poses), track.positions[[0, -1]]
    assert track.times_s[0] == 10.0
    assert np.diff(track.times_s) == pytest.approx(0.02)
    assert np.linalg.norm(ends[:, :2] - AROUND, axis=1) == pytest.approx(ASIDE_M)
    assert np.allclose(track.positions[:, 2], HEIGHT_M)
    assert up[[0, -1], 2] == pytest.approx(1.0)
    (held,) = axes(track.poses_at(np.array([10.0 + motion.midway_s])))
    assert np.arccos(held[2]) == pytest.approx(motion.tilt_rad, abs=1e-3)
    assert held[:2] @ (np.asarray(AROUND) - ends[0, :2]) > 0
    assert track.at(np.array([10.0 + motion.midway_s]))[0, :2] == pytest.approx(motion.over, abs=1e-3)


def test_the_less_there_is_the_more_it_is_tilted() -> None:
    full, nearly_empty = ([drawn(seed, volume).tilt_rad for seed in range(40)] for volume in (120e-6, 20e-6))
    assert np.median(nearly_empty) > np.median(full) + 0.1
    assert max(nearly_empty) <= 1.45


def test_the_same_seed_draws_the_same_and_directions_go_all_round() -> None:
    assert np.array_equal(drawn(3).track(start_s=0.0).poses, drawn(3).track(start_s=0.0).poses)
    angles = [np.arctan2(*(drawn(seed).end - drawn(seed).start)[::-1]) for seed in range(40)]
    assert len({round(angle) for angle in angles}) >= 5
