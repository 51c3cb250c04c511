"""A small rope pushing problem: few particles, short pushes, the real simulator."""

from dataclasses import replace
from functools import cache

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.types import Points
from app.jobs import jit_cache
from app.planner.search.plan import TreePlanner
from app.planner.search.tree import TreeConfig
from app.policy.base import PARKED_POSE, PlanningState
from app.tasks import load
from app.tasks.elements.curves import fill_tube

to_the_bit = pytest.mark.skipif(jax.default_backend() != "cpu", reason="A GPU's threads add up in any order.")
PARTICLES = 80
TASK = load("rope_push")
SPACE = replace(TASK.actions, push_substeps=120, rest_substeps=8)
PHI = jit_cache.phi_of(jit_cache.nominal_model("rope_push"))


def rope(offset_m: float = 0.0, turn_rad: float = 0.0) -> Points:
    """A straight rope around the middle of the table, turned and then moved along y."""
    along = np.linspace(-0.2, 0.2, 41)
    centre = [0.55 + along * np.cos(turn_rad), offset_m + along * np.sin(turn_rad), np.full(41, 0.008)]
    return fill_tube(np.stack(centre, axis=1), TASK.rope.radius_m, PARTICLES)


@cache
def search(branches: int = 4, depth: int = 2) -> TreeConfig:
    return TreeConfig(
        space=SPACE,
        policy=TASK.policy,
        weights=TASK.weights,
        advance=jit_cache.action_simulator("rope_push", PARTICLES),
        branches=branches,
        depth=depth,
    )


def planner() -> TreePlanner:
    return TreePlanner(search=search(), descent=TASK.descent, gradient_steps=3)


def now(x: np.ndarray, count: int) -> PlanningState:
    """The same object for so many candidates, the tool away."""
    return PlanningState.at_rest(batch(x, count))


def tool(count: int) -> jnp.ndarray:
    return jnp.tile(jnp.asarray(PARKED_POSE, jnp.float32), (count, 1))


def batch(x: np.ndarray, count: int) -> jnp.ndarray:
    return jnp.repeat(jnp.asarray(x)[None], count, axis=0)
