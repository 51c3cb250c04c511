"""Random pushes: where they begin, how fast they go, and how the tool is held."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.core.geometry.track import Track
from app.policy.random_pushes import REGION, PushDesign, midway_s, random_track
from app.tasks import load
from app.tasks.elements.curves import fill_tube

TASK, HEIGHT_M = load("rope_push"), 0.006
X = fill_tube(TASK.start(3), TASK.rope.radius_m, 300)
seeds = pytest.mark.parametrize("seed", range(12))


def drawn(seed: int) -> Track:
    return random_track(np.random.default_rng(seed), X, PushDesign(), start_s=5.0, height_m=HEIGHT_M)


@seeds
def test_the_tool_comes_down_beside_the_object_and_stays_in_the_region(seed: int) -> None:
    track = drawn(seed)
    low = track.positions[track.positions[:, 2] < HEIGHT_M + 1e-6, :2]
    assert np.linalg.norm(X[:, :2] - low[0], axis=1).min() > 0.02
    assert np.all((low[[0, -1]] > REGION[:2]) & (low[[0, -1]] < REGION[2:]))


@seeds
def test_it_goes_as_fast_and_as_far_as_was_planned(seed: int) -> None:
    track, plan = drawn(seed), PushDesign()
    steps = np.linalg.norm(np.diff(track.positions[:, :2], axis=0), axis=1)
    fastest = float((steps / np.diff(track.times_s)).max())
    assert 0.8 * plan.speeds_m_s[0] < fastest < 1.5 * plan.speeds_m_s[1]
    assert plan.lengths_m[0] - 1e-9 <= np.linalg.norm(track.positions[-1, :2] - track.positions[0, :2])
    assert float(steps.sum()) <= 1.3 * plan.lengths_m[1]


@seeds
def test_the_tool_points_down_however_it_is_turned(seed: int) -> None:
    turns = Rotation.from_quat(drawn(seed).poses[:, 3:], scalar_first=True)
    np.testing.assert_allclose(turns.apply([0.0, 0.0, 1.0]), np.tile([0.0, 0.0, -1.0], (len(turns), 1)), atol=1e-12)


@seeds
def test_the_moment_on_the_way_is_within_the_push(seed: int) -> None:
    track = drawn(seed)
    moving = track.times_s[np.flatnonzero(np.linalg.norm(np.diff(track.positions[:, :2], axis=0), axis=1) > 1e-6)]
    assert moving[0] < midway_s(track.times_s) < moving[-1]
