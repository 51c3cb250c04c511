"""The scripted pour carries the bowl upright enough, and keeps its lip over the target while it tilts."""

import jax.numpy as jnp
import numpy as np
import pytest

from app.core.motion import pointing_down
from app.planner.actions.pour_actions import tilt, up_of
from app.policy.base import PlanningState
from app.policy.scripted_pour import ScriptedPour
from app.tasks import load

TASK = load("pour_water")
POLICY = TASK.policy
GOAL = TASK.goal(0, 100)


def way(start: tuple[float, float, float]) -> np.ndarray:
    """The tool's poses before each of the policy's actions, and at the end."""
    prepared, poses = POLICY.prepare(GOAL, GOAL), [pointing_down(np.array(start))]
    for _ in range(TASK.horizon):
        now = PlanningState.at_rest(jnp.zeros((1, 1, 3)), poses[-1])
        action = TASK.actions.project(POLICY.act(prepared, now).mean, now)
        poses.append(np.asarray(TASK.actions.after(action, now.tool)[0], np.float64))
    return np.array(poses)


STARTS = pytest.mark.parametrize("start", [(0.34, 0.0, 0.25), (0.30, 0.04, 0.30), (0.60, -0.10, 0.20)])


def lip(poses: np.ndarray) -> np.ndarray:
    """The rim's lowest point."""
    up = np.asarray(up_of(jnp.asarray(poses[:, 3:7])))
    down = -np.array([0.0, 0.0, 1.0]) + up * up[:, 2:]
    return poses[:, :3] + POLICY.radius_m * down / np.maximum(np.linalg.norm(down, axis=1, keepdims=True), 1e-9)


@STARTS
def test_the_bowl_is_empty_at_the_end(start: tuple[float, float, float]) -> None:
    assert float(tilt(jnp.asarray(way(start)[-1, 3:7]))) > np.pi / 2


@STARTS
def test_it_is_tilted_further_than_it_is_carried_only_with_its_lip_over_the_target(
    start: tuple[float, float, float],
) -> None:
    poses = way(start)
    pouring = np.asarray(tilt(jnp.asarray(poses[:, 3:7]))) > POLICY.carried_rad + 1e-3
    away = np.linalg.norm(lip(poses)[pouring, :2] - np.array(TASK.stage.fixtures[0].place_m)[:2], axis=1)
    assert away.max() < TASK.stage.fixtures[0].radius_m - 0.01


def test_the_target_decides_where_it_goes() -> None:
    other = ScriptedPour(radius_m=POLICY.radius_m, height_m=POLICY.height_m, short_m=0.0)
    now = PlanningState.at_rest(jnp.zeros((1, 1, 3)), pointing_down(np.array([0.4, 0.0, 0.2])))
    left, right = (other.act(other.prepare(GOAL, GOAL + np.float32([0, y, 0])), now).mean[0, 1] for y in (0.05, -0.05))
    assert float(left) > 0 > float(right)


def test_a_bowl_with_a_mark_is_poured_into_until_it_holds_as_much_as_in_the_goal() -> None:
    task = load("pour_water-hard")
    policy, goal = task.policy, task.goal(0, 300)
    assert isinstance(policy, ScriptedPour)
    assert policy.mark is not None
    prepared = policy.prepare(goal, goal)
    np.testing.assert_allclose(prepared.middle, policy.mark.place_m[:2])
    leaning = pointing_down(np.array(task.problems.rest_m))
    leaning[3:7] = [0.0, np.cos(0.4), 0.0, -np.sin(0.4)]
    tilts = list[float]()
    for x in (task.particles(task.start(0), 300), goal):
        now = PlanningState.at_rest(jnp.asarray(x)[None], leaning)
        action = task.actions.project(policy.act(prepared, now).mean, now)
        tilts.append(float(tilt(task.actions.after(action, now.tool)[:, 3:7])[0]))
    before = float(tilt(jnp.asarray(leaning[3:7])))
    assert tilts[0] > before + 0.1
    assert tilts[1] < before - 0.1
