"""Carrying: what moves mean as tool paths and motions, and that only allowed ones leave projection."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.arm.gate import check_motion
from app.config import Site
from app.core.motion import pointing_down
from app.planner.actions.carry_actions import Carries, KeptClear
from app.policy.base import PlanningState

SPACE = Carries(
    low=(0.26, -0.34, 0.006),
    high=(0.84, 0.34, 0.36),
    clear=KeptClear(y_m=0.10, half_m=0.08, top_m=0.215),
    max_displacement_m=0.03,
    openings_m=(0.004, 0.040),
    speed_m_s=0.20,
    move_substeps=200,
    rest_substeps=40,
)
CLOTH = np.random.default_rng(0).uniform([0.45, -0.30, 0.0], [0.65, -0.05, 0.004], (50, 3)).astype(np.float32)
project, allowed, tool_path, after = map(jax.jit, (SPACE.project, SPACE.is_allowed, SPACE.tool_path, SPACE.after))
SEEDS = st.integers(0, 2**31 - 1)


def hand(x_m: float = 0.50, y_m: float = -0.10, z_m: float = 0.10, opening_m: float = 0.03) -> np.ndarray:
    pose = pointing_down(np.array([x_m, y_m, z_m]))
    pose[7] = opening_m
    return pose


def now(tool: np.ndarray, count: int = 16) -> PlanningState:
    return PlanningState.at_rest(jnp.tile(jnp.asarray(CLOTH)[None], (count, 1, 1)), tool)


def wild(seed: int, count: int = 16) -> jnp.ndarray:
    """Moves of any length that open the fingers to anything."""
    return jnp.asarray(np.random.default_rng(seed).normal(0, 0.04, (count, SPACE.size)), jnp.float32)


def places(actions: jnp.ndarray, tool: np.ndarray) -> np.ndarray:
    """Place at which each move ends."""
    return tool[:3] + np.cumsum(np.asarray(actions, np.float64).reshape(len(actions), -1, 4)[..., :3], axis=1)


@settings(max_examples=20)
@given(SEEDS)
def test_projected_moves_are_allowed_bounded_and_clear_of_the_rack(seed: int) -> None:
    rng = np.random.default_rng(seed)
    tool = hand(*rng.uniform([0.3, -0.3, 0.22], [0.8, 0.3, 0.34]))
    moves = project(wild(seed), now(tool))
    assert np.all(allowed(moves, now(tool)))
    ends = places(moves, tool)
    assert np.all((ends >= np.array(SPACE.low) - 1e-5) & (ends <= np.array(SPACE.high) + 1e-5))
    inside = (np.abs(ends[..., 1] - 0.10) < 0.08 - 1e-4) & (ends[..., 2] < 0.215 - 1e-4)
    assert not inside.any()
    opening = np.asarray(moves).reshape(16, -1, 4)[..., 3]
    assert opening.min() >= 0.004 - 1e-6
    assert opening.max() <= 0.040 + 1e-6


@settings(max_examples=20)
@given(SEEDS)
def test_projection_leaves_allowed_moves_alone(seed: int) -> None:
    here = now(hand())
    once = project(wild(seed), here)
    np.testing.assert_allclose(project(once, here), once, atol=1e-6)


def test_moves_into_the_rack_and_below_the_table_are_not_allowed() -> None:
    straight = np.zeros((2, 8, 4), np.float32)
    straight[..., 3] = 0.03
    straight[0, :, 1] = 0.025
    straight[1, :, 2] = -0.02
    assert not np.any(allowed(jnp.asarray(straight.reshape(2, -1)), now(hand(), 2)))


def test_a_path_begins_where_the_tool_is_stops_at_every_end_and_rests() -> None:
    moves = project(wild(0), now(hand()))
    tool = jnp.tile(jnp.asarray(hand(), jnp.float32), (16, 1))
    path = np.asarray(tool_path(moves, tool))
    assert path.shape == (16, SPACE.substeps + 1, 8)
    assert path[:, 0, :3] == pytest.approx(np.tile(hand()[:3], (16, 1)), abs=1e-6)
    assert path[:, 0, 7] == pytest.approx(0.03, abs=1e-6)
    end = np.asarray(after(moves, tool))
    assert path[:, -SPACE.rest_substeps :, :3] == pytest.approx(np.tile(end[:, None, :3], (1, 40, 1)), abs=1e-6)
    assert end[:, :3] == pytest.approx(places(moves, hand())[:, -1], abs=1e-5)
    assert end[:, 7] == pytest.approx(np.asarray(moves)[:, -1], abs=1e-6)


def test_a_motion_goes_on_from_the_tool_through_the_ends_of_all_moves_and_the_arm_may_make_it() -> None:
    action, site = np.asarray(project(wild(1), now(hand())))[0], Site()
    motion = SPACE.motion(action, hand(), site)
    assert motion.continues
    assert motion.positions[0] == pytest.approx(hand()[:3])
    assert motion.positions[1:] == pytest.approx(places(action[None], hand())[0], abs=1e-6)
    assert motion.openings[0] == pytest.approx(0.03)
    check_motion(motion, motion.digest(), site)


def test_what_was_measured_is_simulated_as_it_was_planned() -> None:
    moves = jnp.asarray(np.tile(np.float32([0.0, 0.01, 0.02, 0.03]), (1, 8)))
    planned = np.asarray(tool_path(moves, jnp.asarray(hand(), jnp.float32)[None]))[0]
    measured = np.linspace(hand(), np.asarray(after(moves, jnp.asarray(hand(), jnp.float32)[None]))[0], 300)
    assert SPACE.measured_path(measured) == pytest.approx(planned, abs=1e-4)


def test_positions_without_openings_are_refused() -> None:
    with pytest.raises(ValueError, match="openings"):
        SPACE.measured_path(np.zeros((3, 3)))


def test_random_moves_go_to_the_object_or_away_from_it_and_some_close_the_fingers() -> None:
    rng, tool = np.random.default_rng(0), hand(0.3, 0.0, 0.3, 0.04)
    drawn = SPACE.sample(rng, CLOTH, tool, 200).reshape(200, 8, 4)
    assert np.linalg.norm(drawn[..., :3], axis=-1).max() <= 0.03 + 1e-6
    near = np.linalg.norm(places(drawn.reshape(200, -1), tool)[:, -1:] - CLOTH, axis=-1).min(1)
    assert 0.2 < np.mean(near < np.linalg.norm(tool[:3] - CLOTH, axis=-1).min()) < 0.8
    assert set(np.unique(drawn[..., 3])) == {np.float32(0.004), np.float32(0.040)}
    assert 0.3 < np.mean(np.ptp(drawn[..., 3], axis=1) > 0) < 0.7
