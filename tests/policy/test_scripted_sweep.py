"""The scripted sweep: it takes what is outside the goal towards it, and is a pure function of the state."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from app.policy.base import PlanningState
from app.policy.scripted_sweep import ScriptedSweep
from app.tasks import load

TASK = load("bean_sweep")
assert isinstance(TASK.policy, ScriptedSweep)
POLICY: ScriptedSweep = TASK.policy
MIDDLE = np.array([0.55, 0.0])
ANGLES = st.floats(-np.pi, np.pi)
act = jax.jit(lambda prepared, now: POLICY.act(prepared, now).mean)


def heap(middle: np.ndarray, count: int = 60, spread_m: float = 0.015) -> np.ndarray:
    """Beans around their mean `middle` [m]: (count, 3)."""
    drawn = np.random.default_rng(0).standard_normal((count, 2))
    around = middle + spread_m * (drawn - drawn.mean(axis=0))
    return np.concatenate([around, np.full((count, 1), 0.005)], axis=1).astype(np.float32)


def stroke(x: np.ndarray) -> np.ndarray:
    prepared = POLICY.prepare(x, TASK.goal(0, len(x)))
    return np.asarray(act(prepared, PlanningState.at_rest(jnp.asarray(x)[None])))[0]


@settings(max_examples=20)
@given(ANGLES, st.floats(0.12, 0.25))
def test_a_heap_beside_the_goal_is_swept_into_it(angle: float, distance_m: float) -> None:
    at = MIDDLE + distance_m * np.array([np.cos(angle), np.sin(angle)])
    action = stroke(heap(at))
    start, end = action[:2], action[2:]
    ahead = (end - start) / np.linalg.norm(end - start)
    assert (at - start) @ ahead > 0.02
    assert np.linalg.norm(end - MIDDLE) < 0.08
    across = (at - start) @ np.array([-ahead[1], ahead[0]])
    assert abs(across) < POLICY.half_m[0]


@settings(max_examples=10)
@given(ANGLES)
def test_turning_everything_turns_the_stroke(angle: float) -> None:
    quarter = round(angle / (np.pi / 2)) * np.pi / 2
    turn = np.array([[np.cos(quarter), -np.sin(quarter)], [np.sin(quarter), np.cos(quarter)]])
    x = heap(MIDDLE + np.array([0.0, 0.2]))
    turned = x.copy()
    turned[:, :2] = MIDDLE + (x[:, :2] - MIDDLE) @ turn.T
    before, after = stroke(x).reshape(2, 2), stroke(turned).reshape(2, 2)
    np.testing.assert_allclose(after - MIDDLE, (before - MIDDLE) @ turn.T, atol=0.02)


def test_the_larger_heap_goes_first() -> None:
    near, far = heap(MIDDLE + np.array([0.2, 0.0]), 20), heap(MIDDLE - np.array([0.2, 0.0]), 120)
    action = stroke(np.concatenate([near, far]))
    assert action[0] < MIDDLE[0]


def test_beans_in_the_goal_already_do_not_attract_the_paddle() -> None:
    settled = heap(MIDDLE, 300, 0.02)
    lone = heap(MIDDLE + np.array([0.0, 0.2]), 6, 0.005)
    action = stroke(np.concatenate([settled, lone]))
    assert action[1] > 0.2
    assert abs(action[0] - MIDDLE[0]) < POLICY.half_m[0] + 0.04


def test_candidates_do_not_see_each_other() -> None:
    xs = [heap(MIDDLE + np.array(offset)) for offset in ([0.2, 0.0], [0.0, 0.2], [-0.15, 0.1])]
    prepared = POLICY.prepare(xs[0], TASK.goal(0, len(xs[0])))
    together = act(prepared, PlanningState.at_rest(jnp.stack([jnp.asarray(x) for x in xs])))
    for x, action in zip(xs, np.asarray(together), strict=True):
        np.testing.assert_allclose(action, stroke(x), atol=1e-6)


@pytest.mark.parametrize("seed", range(3))
def test_what_it_proposes_for_a_spill_may_be_made_after_projection(seed: int) -> None:
    x = TASK.particles(TASK.start(seed), 300)
    now = PlanningState.at_rest(jnp.asarray(x)[None])
    assert TASK.actions.is_allowed(TASK.actions.project(jnp.asarray(stroke(x))[None], now), now)[0]
