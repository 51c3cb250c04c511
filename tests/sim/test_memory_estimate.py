"""Memory is planned before it is taken."""

import re

import jax
import jax.numpy as jnp
import pytest

from app.core.errors import MemoryPlanError
from app.sim.runtime import memory_estimate
from app.sim.runtime.memory_estimate import available, largest
from app.sim.runtime.rollout import make_rollout
from app.sim.state import State
from tests.sim.scenes import PARTICLES, SCENE, far_tool, phi_with, rope

SIMULATE = make_rollout(SCENE, particle_count=PARTICLES, effects=())


def arguments(candidates: int, steps: int) -> tuple[jax.ShapeDtypeStruct, State, jax.ShapeDtypeStruct]:
    """Shapes alone: what does not fit is refused before anything is allocated."""
    state = State.at_rest(jnp.asarray(rope())[None])
    shapes = (jnp.asarray(phi_with()[:2])[None], state, jnp.asarray(far_tool(steps))[None])
    return jax.tree.map(lambda leaf: jax.ShapeDtypeStruct((candidates, *leaf.shape[1:]), leaf.dtype), shapes)


def test_what_does_not_fit_is_refused_with_the_largest_number_that_would(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(memory_estimate, "available", lambda _device: 64 * 2**20)
    gradient = jax.jit(jax.grad(lambda *given: SIMULATE(*given).x.sum()))
    with pytest.raises(MemoryPlanError, match="would fit") as refused:
        gradient.lower(*arguments(100, 200))
    fits = int(re.search(r"(\d+) would fit", str(refused.value)).group(1))
    assert 0 < fits < 100
    gradient.lower(*arguments(fits, 200))
    with pytest.raises(MemoryPlanError):
        gradient.lower(*arguments(fits + 1, 200))


def test_a_rollout_without_a_gradient_keeps_no_history(monkeypatch: pytest.MonkeyPatch):
    monkeypatch.setattr(memory_estimate, "available", lambda _device: 64 * 2**20)
    jax.jit(SIMULATE).lower(*arguments(100, 200))
    with pytest.raises(MemoryPlanError):
        jax.jit(jax.grad(lambda *given: SIMULATE(*given).x.sum())).lower(*arguments(100, 200))


def test_the_largest_number_is_the_largest():
    assert largest(lambda count: 10 + 3 * count, 100, 1000) == 30
    assert largest(lambda count: 10 + 3 * count, 9, 1000) == 0
    assert largest(lambda count: count, 100, 50) == 50


def test_this_machine_has_memory():
    assert available(jax.devices()[0]) > 2**20
