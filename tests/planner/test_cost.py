"""Eq. 2 of the paper: what each term is, and that the Chamfer part telescopes."""

import dataclasses
import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.config import KeepOut, Reach
from app.core.geometry.chamfer import chamfer_m2
from app.planner.search.cost import Terms, Weights, step_terms
from tests.planner.table import batch, rope

GOAL = jnp.asarray(rope(0.1))
X = [batch(rope(y), 1) for y in (0.0, 0.03, 0.07)]
WEIGHTS = Weights(progress=1.0, contact=1.0)
STAND = KeepOut(name="stand", low=(0.50, 0.0, 0.0), high=(0.60, 0.20, 0.30))
PATH = jnp.asarray([[[0.55, -0.05, 0.006], [0.55, 0.05, 0.006]]])


def test_undiscounted_progress_of_a_branch_is_the_final_minus_the_initial_chamfer_distance() -> None:
    steps = [step_terms(before, after, GOAL, PATH, WEIGHTS) for before, after in itertools.pairwise(X)]
    total = steps[0].plus(steps[1], 1.0).progress[0]
    assert total == pytest.approx(float((chamfer_m2(X[2], GOAL[None]) - chamfer_m2(X[0], GOAL[None]))[0]), rel=1e-4)


def test_a_discounted_branch_prefers_progress_now() -> None:
    nothing, much = Terms(*jnp.zeros((3, 1))), Terms(-jnp.ones(1), *jnp.zeros((2, 1)))
    weights = Weights(progress=1.0, contact=1.0, discount=0.5)
    now = much.plus(nothing, weights.discount).total(weights)
    later = nothing.plus(much, weights.discount).total(weights)
    assert now[0] < later[0]


def test_contact_is_the_level_distance_from_the_end_of_the_push_to_the_nearest_particle() -> None:
    x = X[1]
    nearest = np.linalg.norm(np.asarray(x)[0, :, :2] - np.asarray(PATH)[0, -1, :2], axis=1).min()
    assert step_terms(X[0], x, GOAL, PATH, WEIGHTS).contact[0] == pytest.approx(nearest, abs=1e-5)


def test_the_gradient_of_the_contact_term_draws_a_finger_that_missed_towards_the_object() -> None:
    far = PATH.at[0, -1, 1].set(0.25)
    gradient = jax.grad(lambda path: step_terms(X[0], X[1], GOAL, path, WEIGHTS).contact.sum())(far)
    assert gradient[0, -1, 1] > 0.9


def test_the_gradient_is_finite_where_the_finger_ends_on_a_particle() -> None:
    on = PATH.at[0, -1].set(X[1][0, 0])
    gradient = jax.grad(lambda path: step_terms(X[0], X[1], GOAL, path, WEIGHTS).contact.sum())(on)
    assert np.all(np.isfinite(gradient))


def test_a_path_pays_for_how_far_it_is_out_of_reach_and_is_drawn_back() -> None:
    weights = dataclasses.replace(WEIGHTS, reach=Reach(middle=(0.0, 0.0, 0.3), radius_m=0.6, hand_m=0.294))

    def cost(path: jax.Array) -> jax.Array:
        return step_terms(X[0], X[1], GOAL, path, weights).trespass.sum()

    within = jnp.asarray([[[0.55, 0.0, 0.006], [0.0, -0.59, 0.006]]])
    assert cost(within) == 0.0
    half = jnp.asarray([[[0.55, 0.0, 0.006], [0.63, 0.0, 0.006]]])
    # The second of two points is 30 mm out of reach, and 5 mm before that are kept clear.
    assert cost(half) == pytest.approx(0.035 / 2, rel=1e-4)
    assert np.asarray(jax.grad(cost)(half))[0] == pytest.approx(np.array([[0.0, 0.0, 0.0], [0.5, 0.0, 0.0]]), abs=1e-5)


def test_a_path_pays_for_how_far_it_is_inside_of_what_is_kept_free_and_is_drawn_out_of_it() -> None:
    weights = dataclasses.replace(WEIGHTS, keep_out=(STAND,))

    def cost(path: jax.Array) -> jax.Array:
        return step_terms(X[0], X[1], GOAL, path, weights).trespass.sum()

    beside = jnp.asarray([[[0.55, -0.20, 0.006], [0.55, -0.10, 0.006]]])
    assert cost(beside) == 0.0
    half = jnp.asarray([[[0.55, -0.10, 0.006], [0.58, 0.10, 0.006]]])
    # The second of two points is 20 mm from the nearest face, and 5 mm more are kept clear.
    assert cost(half) == pytest.approx(0.025 / 2, rel=1e-5)
    assert jax.grad(cost)(half)[0].tolist() == [[0.0, 0.0, 0.0], [-0.5, 0.0, 0.0]]
    assert cost(half + jnp.asarray([0.0, 0.0, 0.35])) == 0.0, "above it"
