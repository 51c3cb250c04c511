"""A wall with a gap: the world's wall is the simulator's; starts lie in front of it, goals behind it."""

from dataclasses import replace

import jax.numpy as jnp
import numpy as np
import pytest

from app.core.types import Points
from app.policy.base import PARKED_POSE, PlanningState
from app.sim.tools.box import WallsWithGap
from app.tasks import load
from app.tasks.rod_to_rope import FINGER, KEEP_OUT_M, ROPE, WALL

TASK = load("rod_to_rope")
SPACE = TASK.actions
SEEDS = range(20)


def within(points: np.ndarray, beside_m: float) -> np.ndarray:
    """Mask of the points (..., 2) in a block, or nearer to it than `beside_m` along x and y."""
    blocks = [(np.array(block.place_m[:2]), np.array(block.half_m[:2])) for block in WALL.blocks]
    return np.any([np.all(np.abs(points - at) < half + beside_m, axis=-1) for at, half in blocks], axis=0)


def ways(actions: np.ndarray) -> np.ndarray:
    steps = np.asarray(actions)[:, 2:].reshape(len(actions), -1, 2)
    return np.asarray(actions)[:, None, :2] + np.concatenate([np.zeros_like(steps[:, :1]), steps.cumsum(1)], axis=1)


def fine(way: np.ndarray) -> np.ndarray:
    """The places on the straight lines between waypoints (B, W, 2)."""
    share = np.linspace(0, 1, 11)[:, None]
    return (way[:, :-1, None] * (1 - share) + way[:, 1:, None] * share).reshape(len(way), -1, 2)


def wild(seed: int) -> jnp.ndarray:
    rng = np.random.default_rng(seed)
    start = rng.uniform([0.25, -0.35], [0.85, 0.35], (32, 2))
    heading = rng.uniform(-np.pi, np.pi, 32)
    step = 0.009 * np.stack([np.cos(heading), np.sin(heading)], axis=1)
    steps = np.repeat(step[:, None], 20, axis=1) + rng.normal(0, 0.002, (32, 20, 2))
    return jnp.asarray(np.concatenate([start, steps.reshape(32, -1)], axis=1), jnp.float32)


def seen(seed: int) -> Points:
    return TASK.particles(TASK.start(seed), 60)


def test_the_world_s_blocks_are_the_simulator_s_walls() -> None:
    (walls,) = (tool for tool in TASK.scene.tools if isinstance(tool, WallsWithGap))
    found = {(part.place, part.size[:3]) for part in walls.primitives()}
    assert found == {(block.place_m, block.half_m) for block in WALL.blocks}


@pytest.mark.parametrize("seed", SEEDS)
def test_objects_start_in_front_of_the_wall_and_shall_end_behind_it(seed: int) -> None:
    for task in (TASK, TASK.demonstration_task):
        start, goal = TASK.particles(task.start(seed), 60), task.goal(seed, 60)
        assert task.success.share(start, goal) == 0
        assert task.success.share(goal, goal) == 1
        for x in (start, goal):
            assert not within(x[:, :2], 0.0).any()


def test_the_lesson_is_the_same_task_with_a_rod() -> None:
    assert TASK.demonstration_task.stage.body == replace(ROPE, rigid=True)
    assert TASK.demonstration_task.scene == TASK.scene
    start = TASK.demonstration_task.start(3)
    assert np.linalg.norm(start[-1] - start[0]) == pytest.approx(ROPE.length_m, rel=1e-6)


@pytest.mark.parametrize("seed", range(4))
def test_projected_pushes_keep_the_finger_off_the_walls_along_the_whole_way(seed: int) -> None:
    now = PlanningState.at_rest(jnp.repeat(jnp.asarray(seen(seed))[None], 32, axis=0))
    pushes = SPACE.project(wild(seed), now)
    assert not within(fine(ways(np.asarray(pushes))), FINGER.radius_m).any()


@pytest.mark.parametrize("seed", range(4))
def test_walls_change_nothing_of_pushes_that_keep_off_them(seed: int) -> None:
    now = PlanningState.at_rest(jnp.repeat(jnp.asarray(seen(seed))[None], 32, axis=0))
    free = np.asarray(replace(SPACE, keep_out=()).project(wild(seed), now))
    low, high = np.array(SPACE.region[:2]) + 1e-3, np.array(SPACE.region[2:]) - 1e-3
    inside = np.all((ways(free) > low) & (ways(free) < high), axis=(1, 2))
    off = inside & ~within(ways(free), KEEP_OUT_M).any(axis=1)
    assert 3 < off.sum() < 32
    np.testing.assert_allclose(np.asarray(SPACE.project(wild(seed), now))[off], free[off], atol=1e-5)


def test_a_push_into_a_wall_is_not_allowed_and_one_through_the_gap_is() -> None:
    x = jnp.repeat(jnp.asarray(seen(0))[None], 2, axis=0)
    into, through = ([0.70, y, *[-0.008, 0.0] * 20] for y in (0.20, 0.0))
    np.testing.assert_array_equal(
        SPACE.is_allowed(jnp.asarray([into, through]), PlanningState.at_rest(x)), [False, True]
    )


def test_random_pushes_may_be_made() -> None:
    x = seen(1)
    actions = SPACE.sample(np.random.default_rng(0), x, PARKED_POSE, 16)
    now = PlanningState.at_rest(jnp.repeat(jnp.asarray(x)[None], 16, axis=0))
    assert np.all(SPACE.is_allowed(SPACE.project(jnp.asarray(actions), now), now))
