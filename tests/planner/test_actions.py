"""Pushes: what they mean as tool paths and motions, and that only allowed ones leave projection."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.config import Site
from app.policy.base import PARKED_POSE
from tests.planner.table import SPACE, now, rope, tool

ROPE = rope()
project, allowed = jax.jit(SPACE.project), jax.jit(SPACE.is_allowed)
SEEDS = st.integers(0, 2**31 - 1)


def wild(seed: int, count: int = 16) -> jnp.ndarray:
    """Actions that may start anywhere and go anywhere."""
    rng = np.random.default_rng(seed)
    start = rng.uniform([0.0, -0.6], [1.2, 0.6], size=(count, 2))
    return jnp.asarray(np.concatenate([start, rng.normal(0, 0.02, (count, 40))], axis=1), jnp.float32)


def waypoints(actions: jnp.ndarray) -> np.ndarray:
    steps = np.asarray(actions)[:, 2:].reshape(len(actions), -1, 2)
    return np.asarray(actions)[:, None, :2] + np.concatenate([np.zeros_like(steps[:, :1]), steps.cumsum(1)], axis=1)


@settings(max_examples=20)
@given(SEEDS)
def test_projected_pushes_keep_to_the_region_and_to_the_limits_of_displacement_and_length(seed: int) -> None:
    pushes = waypoints(project(wild(seed), now(ROPE, 16)))
    assert np.all(pushes >= np.array(SPACE.region[:2]) - 1e-5)
    assert np.all(pushes <= np.array(SPACE.region[2:]) + 1e-5)
    lengths = np.linalg.norm(np.diff(pushes, axis=1), axis=2)
    assert lengths.max() <= SPACE.max_displacement_m + 1e-5
    assert lengths.sum(1).max() <= SPACE.max_length_m + 1e-4


@settings(max_examples=20)
@given(SEEDS)
def test_projection_moves_every_start_off_a_lone_rope(seed: int) -> None:
    projected = project(wild(seed), now(ROPE, 16))
    assert np.all(allowed(projected, now(ROPE, 16)))
    near = np.linalg.norm(waypoints(projected)[:, :1] - ROPE[None, :, :2], axis=-1).min(1)
    assert near.min() >= SPACE.clearance_m - 2e-4


@settings(max_examples=20)
@given(SEEDS)
def test_projection_leaves_allowed_pushes_alone(seed: int) -> None:
    x = now(ROPE, 16)
    once = project(wild(seed), x)
    np.testing.assert_allclose(project(once, x), once, atol=2e-6)


@settings(max_examples=20)
@given(SEEDS, st.floats(-np.pi, np.pi))
def test_a_flat_finger_comes_down_beside_the_rope_with_all_of_its_width(seed: int, yaw: float) -> None:
    half_m = (0.015 * np.cos(yaw), 0.015 * np.sin(yaw))
    space = replace(SPACE, core_m=half_m)
    drawn = space.sample(np.random.default_rng(seed), ROPE, PARKED_POSE, 8)
    for starts in (drawn[:, :2], np.asarray(space.project(wild(seed), now(ROPE, 16)))[:, :2]):
        core = starts[:, None] + np.linspace(-1, 1, 31)[:, None] * np.array(half_m)
        near = np.linalg.norm(core[:, :, None] - ROPE[None, None, :, :2], axis=-1).min((1, 2))
        assert near.min() >= SPACE.clearance_m - 4e-4
    assert np.all(space.is_allowed(jnp.asarray(drawn), now(ROPE, 8)))


def test_a_start_from_which_a_flat_finger_reaches_onto_the_rope_is_not_allowed() -> None:
    angles = np.linspace(0, 2 * np.pi, 60, endpoint=False)
    ahead = np.stack([np.cos(angles), np.sin(angles)], axis=1)
    starts = ROPE[40, :2] - (SPACE.clearance_m + 0.002) * ahead
    actions = jnp.asarray(np.concatenate([starts, np.zeros((60, 40))], axis=1), jnp.float32)
    clear = np.flatnonzero(allowed(actions, now(ROPE, 60)))
    assert len(clear) > 0
    for one in clear:
        flat = replace(SPACE, core_m=(0.01 * ahead[one, 0], 0.01 * ahead[one, 1]))
        assert not flat.is_allowed(actions[one][None], now(ROPE, 1))[0]


def test_a_start_on_top_of_the_rope_is_not_allowed() -> None:
    on_top = jnp.zeros((1, 42)).at[0, :2].set(ROPE[0, :2])
    assert not allowed(on_top, now(ROPE, 1))[0]


@settings(max_examples=20)
@given(SEEDS)
def test_random_pushes_start_beside_the_rope_and_go_through_one_of_its_particles(seed: int) -> None:
    drawn = SPACE.sample(np.random.default_rng(seed), ROPE, PARKED_POSE, 8)
    assert np.all(allowed(jnp.asarray(drawn), now(ROPE, 8)))
    start, direction = drawn[:, :2], drawn[:, 2:4] / np.linalg.norm(drawn[:, 2:4], axis=1, keepdims=True)
    offset = ROPE[None, :, :2] - start[:, None]
    aside = np.abs(offset[..., 0] * direction[:, None, 1] - offset[..., 1] * direction[:, None, 0])
    assert aside.min(1).max() < 1e-4


def test_the_tool_path_goes_through_start_and_end_at_push_height_and_rests_at_the_end() -> None:
    action = project(wild(3, 1), now(ROPE, 1))
    path, points = np.asarray(SPACE.tool_path(action, tool(1)))[0], waypoints(action)[0]
    assert path.shape == (SPACE.substeps + 1, 3)
    np.testing.assert_allclose(path[0, :2], points[0], atol=1e-6)
    np.testing.assert_allclose(
        path[SPACE.push_substeps :, :2], np.tile(points[-1], (SPACE.rest_substeps + 1, 1)), atol=1e-6
    )
    np.testing.assert_array_equal(path[:, 2], np.float32(SPACE.height_m))


def test_the_tool_path_is_linear_in_the_action_so_its_derivative_is_exact() -> None:
    a, b = wild(1, 1), wild(2, 1)
    path, tangent = jax.jvp(lambda actions: SPACE.tool_path(actions, tool(1)), (a,), (b,))
    np.testing.assert_allclose(SPACE.tool_path(a + b, tool(1)) - path, tangent - jnp.array([0, 0, 0.0]), atol=1e-5)


def test_the_motion_comes_down_beside_the_rope_and_goes_up_at_the_end_within_the_limits() -> None:
    site = Site()
    action = np.asarray(project(wild(5, 1), now(ROPE, 1)))[0]
    motion = SPACE.motion(action, PARKED_POSE, site)
    assert motion.positions[0, 2] == motion.positions[-1, 2] == pytest.approx(site.travel_height_m)
    np.testing.assert_array_equal(motion.positions[0, :2], motion.positions[1, :2])
    np.testing.assert_array_equal(motion.positions[-1, :2], motion.positions[-2, :2])
    assert site.limits.workspace.contains(motion.positions)
    assert 0 < motion.speeds.min() <= motion.speeds.max() <= site.limits.speed_m_s


def test_what_was_measured_of_a_motion_is_simulated_like_the_action_itself() -> None:
    action = SPACE.sample(np.random.default_rng(0), ROPE, PARKED_POSE, 1)
    motion = SPACE.motion(action[0], PARKED_POSE, Site())
    fine = np.concatenate([np.linspace(a, b, 20) for a, b in zip(motion.positions, motion.positions[1:], strict=False)])
    np.testing.assert_allclose(
        SPACE.measured_path(fine)[:, :2], SPACE.tool_path(jnp.asarray(action), tool(1))[0, :, :2], atol=1e-3
    )


def test_a_motion_that_was_stopped_before_it_came_down_touches_nothing() -> None:
    above = np.array([[0.5, 0.0, 0.12], [0.5, 0.0, 0.08]])
    path = SPACE.measured_path(above)
    np.testing.assert_allclose(path, np.tile([0.5, 0.0, 0.08], (SPACE.substeps + 1, 1)), atol=1e-6)


def test_a_motion_without_measurements_cannot_be_simulated() -> None:
    with pytest.raises(ValueError, match="No tool positions"):
        SPACE.measured_path(np.zeros((0, 3)))


def test_a_push_is_its_ends_and_how_it_bends_between_them() -> None:
    rng = np.random.default_rng(7)
    actions = jnp.asarray(np.concatenate([rng.uniform(0.4, 0.6, (5, 2)), rng.uniform(-0.002, 0.01, (5, 40))], axis=1))

    ends, bends = SPACE.ends(actions), SPACE.bends(actions)
    np.testing.assert_allclose(SPACE.stroke(ends, bends), actions, atol=1e-5)
    moved = SPACE.ends(SPACE.stroke(ends + jnp.array([[0.01, -0.02]]), 0.5 * bends))
    np.testing.assert_allclose(moved, ends + jnp.array([[0.01, -0.02]]), atol=1e-5)
