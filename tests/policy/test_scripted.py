"""The scripted policy: from behind, towards the goal, where the error is; and it alone gets a rope nearer its goal."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.config import Site
from app.core.geometry.chamfer import chamfer_m2
from app.core.types import Points
from app.policy.base import PARKED_POSE, PlanningState
from app.tasks import load
from app.tasks.elements.curves import fill_tube

TASK = load("rope_push")
POLICY, SPACE = TASK.policy, TASK.actions
act, project = jax.jit(lambda prepared, now: POLICY.act(prepared, now).mean), jax.jit(SPACE.project)


def straight(y_m: float) -> Points:
    along = np.linspace(0.35, 0.75, 41)
    return fill_tube(np.stack([along, np.full(41, y_m), np.full(41, 0.008)], axis=1), 0.008, 300)


def bent(height_m: float) -> Points:
    """A rope along x whose middle reaches out to `height_m` along y."""
    along = np.linspace(0.0, 1.0, 41)
    curve = np.stack(
        [0.35 + 0.4 * along, height_m * np.exp(-(((along - 0.5) / 0.15) ** 2)), np.full(41, 0.008)], axis=1
    )
    return fill_tube(curve, 0.008, 300)


def at(x: Points) -> PlanningState:
    return PlanningState.at_rest(jnp.asarray(x)[None])


def pushed(x: Points, goal: Points) -> np.ndarray:
    """The policy's push as waypoints (21, 2) [m]."""
    action = np.asarray(act(POLICY.prepare(x, goal), at(x)))[0]
    return action[:2] + np.concatenate([np.zeros((1, 2)), action[2:].reshape(-1, 2).cumsum(0)])


def test_it_starts_on_the_far_side_and_ends_where_the_rope_shall_be_less_the_thickness_of_finger_and_rope() -> None:
    path = pushed(straight(0.0), straight(0.06))
    assert path[0, 1] < -SPACE.clearance_m
    assert path[-1, 1] == pytest.approx(0.06 - TASK.rope.radius_m - TASK.finger.radius_m, abs=0.006)
    assert abs(path[-1, 0] - path[0, 0]) < 0.01


def test_it_pushes_the_other_way_where_the_goal_is_on_the_other_side() -> None:
    assert pushed(straight(0.0), straight(-0.06))[0, 1] > SPACE.clearance_m


def test_it_pushes_where_the_error_is() -> None:
    path = pushed(straight(0.0), bent(0.05))
    assert abs(path[0, 0] - 0.55) < 0.05


def test_which_end_of_the_goal_comes_first_does_not_matter() -> None:
    goal = bent(0.05)
    prepared = POLICY.prepare(straight(0.0), goal)
    reversed_ends = prepared._replace(goals=prepared.goals[::-1])
    x = at(straight(0.0))
    np.testing.assert_allclose(act(prepared, x), act(reversed_ends, x), atol=1e-5)


def test_candidates_do_not_hear_of_each_other() -> None:
    prepared = POLICY.prepare(straight(0.0), bent(0.05))
    states = jnp.stack([jnp.asarray(straight(y)) for y in (0.0, 0.03)])
    both, second = act(prepared, PlanningState.at_rest(states)), act(prepared, PlanningState.at_rest(states[1:]))
    np.testing.assert_allclose(both[1], second[0], atol=1e-5)


@pytest.mark.parametrize("noise_m", [0.0, 1e-7, 1e-5])
def test_a_rope_at_its_goal_is_hardly_pushed(noise_m: float) -> None:
    x = straight(0.0)
    path = pushed(x, x + np.random.default_rng(0).normal(0, noise_m, x.shape).astype(np.float32))
    reach = np.abs(path[:, 1]).min()
    assert reach > TASK.rope.radius_m + TASK.finger.radius_m - 0.004


@pytest.mark.parametrize("seed", range(3))
def test_alone_it_brings_the_rope_of_another_engine_nearer_to_its_goal(seed: int) -> None:
    from bench.table import Table

    table, goal = Table(TASK, seed, 300), TASK.goal(seed, 300)
    x = table.observe()
    distances = [chamfer_m2(x, goal)]
    for _ in range(6):
        action = project(act(POLICY.prepare(x, goal), at(x)), at(x))
        table.execute(SPACE.motion(np.asarray(action)[0], PARKED_POSE, Site()))
        x = table.observe()
        distances.append(chamfer_m2(x, goal))
    assert min(distances) < 0.5 * distances[0]
