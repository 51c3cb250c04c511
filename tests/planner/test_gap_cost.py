"""Distances through a gap: Chamfer's where nothing is in the way, and never shorter than the way round is."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.core.geometry.chamfer import chamfer_m2
from app.planner.actions.gap_cost import Passage

WALL = Passage(x_m=0.6, low_m=-0.03, high_m=0.03)
SEEDS = st.integers(0, 2**31 - 1)
distance = jax.jit(WALL)


def front(seed: int) -> jnp.ndarray:
    return jnp.asarray(np.random.default_rng(seed).uniform((0.3, -0.3, 0.0), (0.59, 0.3, 0.02), (12, 3)), jnp.float32)


def back(seed: int) -> jnp.ndarray:
    return front(seed) + jnp.array([0.31, 0.0, 0.0])


def point(x: float, y: float) -> jnp.ndarray:
    return jnp.asarray([[x, y, 0.008]])


@settings(max_examples=20)
@given(SEEDS)
def test_on_one_side_of_the_wall_it_is_the_chamfer_distance(seed: int) -> None:
    x, goal = front(seed), front(seed + 1)
    assert float(distance(x[None], goal)[0]) == pytest.approx(float(chamfer_m2(x, goal)), rel=1e-4, abs=1e-8)


@settings(max_examples=20)
@given(SEEDS)
def test_through_the_wall_it_is_never_less_than_the_chamfer_distance(seed: int) -> None:
    x, goal = front(seed), back(seed + 1)
    assert float(distance(x[None], goal)[0]) >= float(chamfer_m2(x, goal)) - 1e-7


def test_a_way_that_leads_through_the_gap_is_straight() -> None:
    a, b = point(0.5, -0.02), point(0.7, 0.02)
    assert float(distance(a[None], b)[0]) == pytest.approx(2 * (0.2**2 + 0.04**2), rel=1e-3)


def test_a_way_that_does_not_bends_at_the_end_of_the_wall_that_is_nearer() -> None:
    a, b = point(0.5, 0.2), point(0.7, 0.2)
    bent = 2 * np.hypot(0.1, 0.2 - 0.03)
    assert float(distance(a[None], b)[0]) == pytest.approx(2 * bent**2, rel=1e-3)


def test_in_front_of_the_wall_it_falls_towards_the_gap_where_the_chamfer_distance_falls_away_from_it() -> None:
    goal = point(0.7, 0.2)

    def slope(measure: object, y: float) -> float:
        return float(jax.grad(lambda y: measure(jnp.stack([jnp.array([[0.58, y, 0.008]])]), goal).sum())(y))

    assert slope(WALL, 0.15) > 0
    assert slope(lambda x, goal: chamfer_m2(x, goal[None]), 0.15) < 0


@settings(max_examples=20)
@given(SEEDS)
def test_its_gradient_is_finite(seed: int) -> None:
    x, goal = jnp.concatenate([front(seed), back(seed)]), jnp.concatenate([front(seed + 1), back(seed + 1)])
    x = x.at[0].set(goal[0]).at[1, 0].set(0.6)
    assert np.all(np.isfinite(jax.grad(lambda x: distance(x[None], goal).sum())(x)))
