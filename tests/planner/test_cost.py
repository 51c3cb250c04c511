"""Eq. 2 of the paper: what each term is, and that the Chamfer part telescopes."""

import itertools

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.chamfer import chamfer_m2
from app.planner.cost import Terms, Weights, step_terms
from tests.planner.table import batch, rope

GOAL = jnp.asarray(rope(0.1))
X = [batch(rope(y), 1) for y in (0.0, 0.03, 0.07)]
PATH = jnp.asarray([[[0.55, -0.05, 0.006], [0.55, 0.05, 0.006]]])


def test_undiscounted_progress_of_a_branch_is_the_final_minus_the_initial_chamfer_distance() -> None:
    steps = [step_terms(before, after, GOAL, PATH) for before, after in itertools.pairwise(X)]
    total = steps[0].plus(steps[1], 1.0).progress[0]
    assert total == pytest.approx(float((chamfer_m2(X[2], GOAL[None]) - chamfer_m2(X[0], GOAL[None]))[0]), rel=1e-4)


def test_a_discounted_branch_prefers_progress_now() -> None:
    nothing, much = Terms(jnp.zeros(1), jnp.zeros(1)), Terms(-jnp.ones(1), jnp.zeros(1))
    weights = Weights(progress=1.0, contact=1.0, discount=0.5)
    now = much.plus(nothing, weights.discount).total(weights)
    later = nothing.plus(much, weights.discount).total(weights)
    assert now[0] < later[0]


def test_contact_is_the_level_distance_from_the_end_of_the_push_to_the_nearest_particle() -> None:
    x = X[1]
    nearest = np.linalg.norm(np.asarray(x)[0, :, :2] - np.asarray(PATH)[0, -1, :2], axis=1).min()
    assert step_terms(X[0], x, GOAL, PATH).contact[0] == pytest.approx(nearest, abs=1e-5)


def test_the_gradient_of_the_contact_term_draws_a_finger_that_missed_towards_the_object() -> None:
    far = PATH.at[0, -1, 1].set(0.25)
    gradient = jax.grad(lambda path: step_terms(X[0], X[1], GOAL, path).contact.sum())(far)
    assert gradient[0, -1, 1] > 0.9


def test_the_gradient_is_finite_where_the_finger_ends_on_a_particle() -> None:
    on = PATH.at[0, -1].set(X[1][0, 0])
    gradient = jax.grad(lambda path: step_terms(X[0], X[1], GOAL, path).contact.sum())(on)
    assert np.all(np.isfinite(gradient))
