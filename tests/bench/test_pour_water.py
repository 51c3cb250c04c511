"""The reference problem of pouring: its metric and its motions mean what they say; rewards of pouring in the cell."""

import jax.numpy as jnp
import numpy as np
import pytest

from app.core.errors import UsageError
from bench.pour_cell import normalised, reward
from bench.pouring import reference
from bench.pouring.reference import ACTION_UNITS, DATA, STEPS, SUBSTEPS, TARGET_M, best_while_held, poses, problem
from bench.pouring.search import actions_of, scripted

recorded = pytest.mark.skipif(not (DATA / "pour_water_start.npz").is_file(), reason=f"no reference problem in {DATA}")
RNG = np.random.default_rng(0)
HELD = jnp.asarray(RNG.uniform(-0.1, 0.1, (3, 3)), jnp.float32)


def test_without_its_files_the_problem_says_which_are_missing(tmp_path) -> None:
    with pytest.raises(UsageError, match="pour_water_goal"):
        problem(tmp_path)


def test_the_reward_is_1_at_the_goal_and_falls_with_the_distance_of_pairs() -> None:
    goal = jnp.asarray(RNG.uniform(0, 0.1, (50, 3)), jnp.float32)
    shifted = jnp.stack([goal, goal + 0.03, goal[::-1]])
    found = np.asarray(reference.reward(shifted, goal))
    assert found[0] == pytest.approx(1.0, abs=1e-4)
    assert found[1] == pytest.approx(np.exp(-0.3), abs=1e-4)
    assert found[2] < 0.9


def test_actions_are_shifts_and_turns_divided_by_500_and_never_lift() -> None:
    actions = jnp.zeros((3, STEPS, 6)).at[0, :, 0].set(1.0).at[1, :, 1].set(30.0).at[2, :, 3].set(1.0)
    path = np.asarray(poses(actions, HELD))
    assert path.shape == (3, STEPS * SUBSTEPS + 1, 7)
    moved = path[:, -1, :3] - np.asarray(HELD)
    np.testing.assert_allclose(moved, [[STEPS / ACTION_UNITS, 0, 0], [0, 0, 0], [0, 0, 0]], atol=1e-5)
    np.testing.assert_allclose(path[2, -1, 3:], [np.cos(0.1), np.sin(0.1), 0, 0], atol=1e-4)
    np.testing.assert_allclose(np.linalg.norm(path[..., 3:], axis=-1), 1.0, atol=1e-5)


def test_water_is_inside_below_the_rim_and_within_the_target_s_inner_wall() -> None:
    x = jnp.asarray(TARGET_M) + jnp.array([[0.0, 0, -0.02], [0.05, 0, -0.04], [0, 0, 0.01], [0.2, 0, -0.02]])
    assert float(reference.inside(x[None])[0]) == 0.5


def test_scripts_carry_the_bowl_to_the_target_and_keep_to_the_bound() -> None:
    parameters = np.array([[0.5, 0.4, 0.4, 1.5, 0.05, 0.5, 0.0]])
    knots = scripted(parameters, np.array([0.02, 0.2]), 10)
    np.testing.assert_allclose(knots[0].sum(axis=0), [0.02, 0.2 + 0.05 - 0.025, -1.5, 0, 0], atol=1e-12)
    wide, narrow = actions_of(knots, 30.0), actions_of(knots, 1.0)
    np.testing.assert_allclose(wide[0].sum(axis=0) / ACTION_UNITS, [0.02, 0, 0.225, -1.5, 0, 0], atol=1e-5)
    assert np.abs(narrow).max() == 1.0


@recorded
def test_doing_nothing_earns_what_it_does_in_the_reference() -> None:
    given = problem()
    water = given.water - given.water.mean(axis=0)
    middles = given.held - [0.0, 0.0, 0.05]
    rewards = reference.reward(jnp.asarray(water[None] + middles[:, None], jnp.float32), jnp.asarray(given.goal))
    assert 0.20 < float(rewards.mean()) < 0.32


@recorded
def test_water_that_is_held_can_have_less_than_the_paper_s_planner_has() -> None:
    assert 0.5 < best_while_held(problem()) < 0.69
    # Squeezed to half of its volume it would lie lower.
    assert best_while_held(problem()) < best_while_held(problem(), 0.5) < 0.69


def test_a_normalised_reward_is_0_for_nothing_and_1_at_the_goal() -> None:
    nothing = reward(0.1)
    assert normalised(nothing, nothing) == 0.0
    assert normalised(reward(0.0), nothing) == 1.0
