"""A push or a sweep that somebody asked for is moved to where the object is, and nothing else of it changes."""

from dataclasses import replace

import numpy as np
import pytest

from app.config import Site
from app.core.errors import PlanningError
from app.core.geometry.track import Track
from app.jobs.suggestions.strokes import aim_at, stroke_along
from app.jobs.worker_api import nominal_model, plan_of_suggestion
from app.planner.actions.actions import Pushes
from app.planner.actions.sweep_actions import Sweeps
from app.policy.random_pushes import PushDesign, random_track
from app.policy.random_sweeps import random_sweep, sweep_design
from app.tasks import load
from tests.planner.table import rope

TASK, SITE = load("rope_push"), Site()
PUSHES = TASK.actions
assert isinstance(PUSHES, Pushes)


def track(seed: int) -> Track:
    return random_track(np.random.default_rng(seed), rope(), PushDesign(), start_s=10.0, height_m=0.006)


@pytest.mark.parametrize("seed", range(4))
def test_a_track_becomes_a_motion_along_the_same_way_at_the_same_speed(seed: int) -> None:
    wanted = track(seed)
    motion = stroke_along(wanted, PUSHES, SITE)
    low = wanted.positions[wanted.positions[:, 2] < 0.0065]
    apart = np.linalg.norm(motion.positions[1:-1, None, :2] - low[None, :, :2], axis=2).min(1)
    assert apart.max() < 0.005
    np.testing.assert_allclose(motion.positions[[1, -2], :2], low[[0, -1], :2], atol=1e-9)
    assert motion.positions[[0, -1], 2] == pytest.approx(SITE.travel_height_m)
    fastest = np.linalg.norm(np.diff(low, axis=0), axis=1).max() / 0.02
    assert 0.5 * min(fastest, SITE.limits.speed_m_s) < motion.speeds[5] <= min(fastest, SITE.limits.speed_m_s) + 1e-9


def test_a_push_that_fits_is_left_where_it_is() -> None:
    motion = stroke_along(track(1), PUSHES, SITE)
    assert aim_at(motion, rope(), PUSHES, SITE).digest() == motion.digest()


@pytest.mark.parametrize("shift", [(0.08, 0.05), (-0.1, -0.08), (0.0, 0.02)])
def test_a_push_follows_an_object_that_lies_elsewhere(shift: tuple[float, float]) -> None:
    motion = stroke_along(track(1), PUSHES, SITE)
    x = rope() + np.float32([*shift, 0.0])
    found = aim_at(motion, x, PUSHES, SITE)
    np.testing.assert_allclose(np.diff(found.positions, axis=0), np.diff(motion.positions, axis=0), atol=1e-12)
    np.testing.assert_array_equal(found.speeds, motion.speeds)
    near = np.linalg.norm(found.positions[1:-1, None, :2] - x[None, :, :2], axis=2).min(1)
    assert near[0] >= PUSHES.clearance_m
    assert near.min() < 0.006
    assert SITE.limits.workspace.contains(found.positions)


def test_a_push_that_fits_nowhere_says_so() -> None:
    motion = stroke_along(track(1), PUSHES, SITE)
    long = replace(motion, positions=motion.positions * [8.0, 8.0, 1.0])
    with pytest.raises(PlanningError, match="move the object towards the middle"):
        aim_at(long, rope(), PUSHES, SITE)


def test_the_plan_of_an_asked_push_is_simulated_and_of_one_branch() -> None:
    motion = stroke_along(track(1), PUSHES, SITE)
    found = plan_of_suggestion("rope_push", rope(), rope(0.05), nominal_model("rope_push"), motion)
    assert not isinstance(found, str)
    assert [branch.origin for branch in found.branches] == ["asked"]
    assert found.motion.digest() == motion.digest()
    assert np.linalg.norm(found.predicted - rope(), axis=1).max() > 0.01
    assert np.isfinite(found.predicted_chamfer_m2)


BEANS = load("bean_sweep")
SWEEPS = BEANS.actions
assert isinstance(SWEEPS, Sweeps)
COUNT = BEANS.preset("cpu").particle_count


def beans(seed: int) -> np.ndarray:
    return BEANS.particles(BEANS.start(seed), COUNT)


def sweep(seed: int) -> Track:
    stroke = random_sweep(
        np.random.default_rng(seed), beans(1), sweep_design(1, 1), radius_m=0.005, half_m=SWEEPS.half_m
    )
    return stroke.track(start_s=10.0, height_m=SWEEPS.height_m)


@pytest.mark.parametrize("seed", range(3))
def test_a_sweep_becomes_a_motion_with_the_paddle_across_its_way_at_its_own_speed(seed: int) -> None:
    wanted = sweep(seed)
    motion = stroke_along(wanted, SWEEPS, SITE)
    low = wanted.positions[wanted.positions[:, 2] < SWEEPS.height_m + 1e-4]
    np.testing.assert_allclose(motion.positions[[1, 2], :2], low[[0, -1], :2], atol=1e-6)
    way, turn = motion.positions[2] - motion.positions[1], motion.turns[1]
    across = np.array([turn[1] ** 2 - turn[2] ** 2, 2 * turn[1] * turn[2]])
    assert across @ way[:2] == pytest.approx(0.0, abs=1e-6)
    fastest = np.linalg.norm(np.diff(low, axis=0), axis=1).max() / 0.02
    assert 0.4 * min(fastest, SITE.limits.speed_m_s) < motion.speeds[2] <= min(fastest, SITE.limits.speed_m_s) + 1e-9


@pytest.mark.parametrize("seed", range(2, 5))
def test_a_sweep_follows_beans_that_lie_elsewhere_and_takes_some_along(seed: int) -> None:
    motion, x = stroke_along(sweep(0), SWEEPS, SITE), beans(seed)
    found = aim_at(motion, x, SWEEPS, SITE)
    np.testing.assert_allclose(np.diff(found.positions, axis=0), np.diff(motion.positions, axis=0), atol=1e-12)
    np.testing.assert_array_equal(found.turns, motion.turns)
    plan = plan_of_suggestion("bean_sweep", x, BEANS.goal(seed, COUNT), nominal_model("bean_sweep"), motion)
    assert not isinstance(plan, str)
    assert plan.motion.digest() == found.digest()
    assert plan.branches[0].tool_path.shape[1] == 3
    assert np.linalg.norm(plan.predicted - x, axis=1).max() > 0.01
