"""Sweeps: what they mean as tool paths and motions, and that only allowed ones leave projection."""

from dataclasses import replace
from itertools import pairwise

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import example, given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.config import Site
from app.core.motion import TOOL_DOWN
from app.planner.actions.sweep_actions import Sweeps
from app.policy.base import PARKED_POSE, PlanningState
from app.tasks import load

TASK = load("bean_sweep")
assert isinstance(TASK.actions, Sweeps)
SPACE: Sweeps = TASK.actions
LOW, HIGH = np.array(SPACE.region[:2]), np.array(SPACE.region[2:])
X = TASK.particles(TASK.start(0), 200)
NOW = PlanningState.at_rest(jnp.repeat(jnp.asarray(X)[None], 16, axis=0))
ONE = PlanningState.at_rest(jnp.asarray(X)[None])
NOWHERE = jnp.asarray(PARKED_POSE, jnp.float32)[None]
project, allowed = jax.jit(SPACE.project), jax.jit(SPACE.is_allowed)
SEEDS = st.integers(0, 2**31 - 1)


def wild(seed: int, count: int = 16) -> jnp.ndarray:
    """Actions that may start and end anywhere."""
    rng = np.random.default_rng(seed)
    return jnp.asarray(rng.uniform([0.0, -0.6] * 2, [1.2, 0.6] * 2, (count, 4)), jnp.float32)


def in_paddle(x: np.ndarray, action: np.ndarray) -> np.ndarray:
    """The particles from the paddle that comes down where the sweep starts, across it and along it [m]."""
    way = action[2:] - action[:2]
    ahead = way / np.linalg.norm(way)
    offset = x[:, :2] - action[:2]
    return np.abs(np.stack([offset @ [ahead[1], -ahead[0]], offset @ ahead], axis=1))


@settings(max_examples=20)
@given(SEEDS)
@example(375)
def test_projected_sweeps_keep_to_the_region_and_to_the_limits_of_length(seed: int) -> None:
    swept = np.asarray(project(wild(seed), NOW))
    assert np.all(swept.reshape(-1, 2) >= LOW - 1e-5)
    assert np.all(swept.reshape(-1, 2) <= HIGH + 1e-5)
    assert np.linalg.norm(swept[:, 2:] - swept[:, :2], axis=1).max() <= SPACE.length_m[1] + 1e-4


@settings(max_examples=20)
@given(SEEDS)
def test_the_paddle_of_an_allowed_sweep_comes_down_on_no_bean(seed: int) -> None:
    swept = project(wild(seed), NOW)
    good = np.asarray(allowed(swept, NOW))
    assert good.mean() > 0.5
    for action in np.asarray(swept)[good]:
        assert (in_paddle(X, action) - SPACE.half_m).max(axis=1).min() >= SPACE.clearance_m / np.sqrt(2) - 2e-4


@settings(max_examples=20)
@given(SEEDS)
def test_projection_leaves_allowed_sweeps_alone(seed: int) -> None:
    once = project(wild(seed), NOW)
    good = np.asarray(allowed(once, NOW))
    np.testing.assert_allclose(np.asarray(project(once, NOW))[good], np.asarray(once)[good], atol=2e-6)


def test_a_start_on_top_of_a_bean_is_not_allowed() -> None:
    on_top = jnp.asarray([[*X[0, :2], *(X[0, :2] + 0.1)]])
    assert not allowed(on_top, ONE)[0]


def test_a_sweep_that_goes_nowhere_gets_a_length_or_is_not_allowed() -> None:
    nowhere = jnp.asarray([[0.5, 0.1, 0.5, 0.1]])
    assert not allowed(nowhere, ONE)[0]
    swept = np.asarray(project(nowhere, ONE))[0]
    assert np.linalg.norm(swept[2:] - swept[:2]) == pytest.approx(SPACE.length_m[0], abs=1e-5)


@settings(max_examples=10)
@given(SEEDS)
def test_random_sweeps_start_beside_the_beans_and_go_through_one_of_their_particles(seed: int) -> None:
    drawn = SPACE.sample(np.random.default_rng(seed), X, PARKED_POSE, 8)
    assert np.all(allowed(jnp.asarray(drawn), PlanningState.at_rest(NOW.x[:8])))
    for action in drawn:
        across, along = in_paddle(X, action).T
        assert across.min() < 1e-4 + SPACE.half_m[0]
        assert np.any((across < 1e-4) & (along < SPACE.half_m[1] + 1.3 * SPACE.clearance_m + 1e-4))


def test_the_tool_path_goes_from_start_to_end_at_sweep_height_and_rests_there() -> None:
    action = project(wild(3, 1), ONE)
    path = np.asarray(SPACE.tool_path(action, NOWHERE))[0]
    assert path.shape == (SPACE.substeps + 1, 7)
    np.testing.assert_allclose(path[0, :2], action[0, :2], atol=1e-6)
    np.testing.assert_allclose(
        path[SPACE.sweep_substeps :, :2], np.tile(action[0, 2:], (SPACE.rest_substeps + 1, 1)), atol=1e-6
    )
    np.testing.assert_array_equal(path[:, 2], np.float32(SPACE.height_m))


@settings(max_examples=20)
@given(SEEDS)
def test_the_paddle_is_turned_across_the_sweep_in_the_simulator_and_on_the_arm_alike(seed: int) -> None:
    action = np.asarray(project(wild(seed, 1), ONE))
    way = (action[0, 2:] - action[0, :2]) / np.linalg.norm(action[0, 2:] - action[0, :2])
    simulated = Rotation.from_quat(
        np.asarray(SPACE.tool_path(jnp.asarray(action), NOWHERE))[0, 0, 3:], scalar_first=True
    )
    turned = Rotation.from_quat(SPACE.motion(action[0], PARKED_POSE, Site()).turns[1], scalar_first=True)
    upright = turned * Rotation.from_quat(TOOL_DOWN, scalar_first=True).inv()
    for paddle in (simulated, upright):
        normal, up = paddle.apply([0.0, 1.0, 0.0]), paddle.apply([0.0, 0.0, 1.0])
        assert abs(normal[:2] @ way) == pytest.approx(1.0, abs=1e-5)
        np.testing.assert_allclose(up, [0.0, 0.0, 1.0], atol=1e-6)
    assert upright.magnitude() <= np.pi / 2 + 1e-6


def test_the_derivative_of_the_tool_path_is_that_of_finite_differences() -> None:
    action = jnp.asarray([[0.4, -0.1, 0.6, 0.05]])
    weights = np.random.default_rng(0).normal(size=(1, SPACE.substeps + 1, 7)).astype(np.float32)

    def weighed(action: jax.Array) -> jax.Array:
        return (weights * SPACE.tool_path(action, NOWHERE)).sum()

    slope = jax.grad(weighed)(action)
    for axis in range(4):
        step = np.zeros((1, 4), np.float32)
        step[0, axis] = 1e-2
        ends = [np.asarray(SPACE.tool_path(action + sign * step, NOWHERE), np.float64) for sign in (1, -1)]
        assert slope[0, axis] == pytest.approx(((ends[0] - ends[1]) * weights).sum() / 2e-2, rel=0.02, abs=0.05)


def test_the_motion_comes_down_turned_and_goes_up_at_the_end_within_the_limits() -> None:
    site = Site()
    motion = SPACE.motion(np.asarray(project(wild(5, 1), ONE))[0], PARKED_POSE, site)
    assert motion.positions[0, 2] == motion.positions[-1, 2] == pytest.approx(site.travel_height_m)
    np.testing.assert_array_equal(motion.positions[0, :2], motion.positions[1, :2])
    np.testing.assert_array_equal(motion.positions[-1, :2], motion.positions[-2, :2])
    assert len(motion.turns) == len(motion.positions)
    assert site.limits.workspace.contains(motion.positions)
    assert 0 < motion.speeds.min() <= motion.speeds.max() <= site.limits.speed_m_s


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_what_was_measured_of_a_motion_is_simulated_like_the_action_itself(seed: int) -> None:
    action = SPACE.sample(np.random.default_rng(seed), X, PARKED_POSE, 1)
    poses = SPACE.motion(action[0], PARKED_POSE, Site()).poses
    fine = np.concatenate([np.linspace(a, b, 20) for a, b in pairwise(poses)])
    measured, meant = SPACE.measured_path(fine), np.asarray(SPACE.tool_path(jnp.asarray(action), NOWHERE))[0]
    np.testing.assert_allclose(measured[:, :3], meant[:, :3], atol=1e-3)
    alike = np.abs((measured[:, 3:] * meant[:, 3:]).sum(1))
    np.testing.assert_allclose(alike, 1.0, atol=1e-4)


def test_a_motion_that_was_stopped_before_it_came_down_touches_nothing() -> None:
    above = np.array([[0.5, 0.0, 0.12], [0.5, 0.0, 0.08]])
    assert SPACE.measured_path(above)[:, 2].min() == pytest.approx(0.08)


def test_a_motion_without_measurements_cannot_be_simulated() -> None:
    with pytest.raises(ValueError, match="No tool positions"):
        SPACE.measured_path(np.zeros((0, 8)))


def test_where_beans_lie_everywhere_no_sweep_is_allowed() -> None:
    tiny = replace(SPACE, reach_m=(0.004, 0.004))
    side = np.stack(np.meshgrid(np.linspace(0.2, 0.9, 60), np.linspace(-0.4, 0.4, 60)), axis=-1).reshape(-1, 2)
    crowd = PlanningState.at_rest(
        jnp.asarray(np.concatenate([side, np.full((3600, 1), 0.005)], axis=1), jnp.float32)[None]
    )
    assert not tiny.is_allowed(tiny.project(wild(0, 1), crowd), crowd)[0]
