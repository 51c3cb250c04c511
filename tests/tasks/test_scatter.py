"""Spilt beans, the goal that they are swept to, and the particles that perfect cameras would see of them."""

from dataclasses import replace

import numpy as np
import pytest

from app.core.geometry.chamfer import chamfer_m2
from app.tasks.bean_sweep import BEANS, MAT, TASK
from app.tasks.elements.scatter import BeanProblems
from app.tasks.elements.success import OnMat

assert isinstance(TASK.problems, BeanProblems)
PROBLEMS: BeanProblems = TASK.problems


def in_bean(points: np.ndarray, bean: np.ndarray) -> np.ndarray:
    """Distance [m] of points from the bean with the end middles `bean` (2, 3); negative inside."""
    along = bean[1] - bean[0]
    share = np.clip((points - bean[0]) @ along / (along @ along), 0, 1)
    return np.linalg.norm(points - bean[0] - share[:, None] * along, axis=1) - BEANS.radius_m


@pytest.mark.parametrize("seed", range(6))
def test_beans_lie_on_the_table_off_the_mat_and_apart(seed: int) -> None:
    beans = TASK.start(seed).reshape(-1, 2, 3)
    assert len(beans) == BEANS.count
    np.testing.assert_allclose(beans[..., 2], BEANS.radius_m)
    np.testing.assert_allclose(
        np.linalg.norm(beans[:, 1] - beans[:, 0], axis=1), BEANS.length_m - 2 * BEANS.radius_m, atol=1e-9
    )
    assert np.linalg.norm(beans[..., :2] - MAT.place_m, axis=-1).min() > MAT.radius_m + BEANS.radius_m
    for index, bean in enumerate(beans):
        others = np.delete(beans, index, axis=0).reshape(-1, 3)
        assert in_bean(others, bean).min() > BEANS.radius_m - 3e-4


@pytest.mark.parametrize("seed", range(6))
def test_no_problem_is_solved_at_the_start_and_all_are_where_the_goal_is(seed: int) -> None:
    start, goal = TASK.particles(TASK.start(seed), 300), TASK.goal(seed, 300)
    assert TASK.success.share(start, goal) == 0
    assert TASK.success.is_reached(goal, goal)
    assert chamfer_m2(start, goal) > 0.01


def test_a_seed_is_one_problem_and_another_is_another() -> None:
    assert np.array_equal(TASK.start(3), TASK.start(3))
    assert not np.array_equal(TASK.start(3), TASK.start(4))


@pytest.mark.parametrize("count", [50, 120, 300])
def test_each_bean_has_its_share_of_particles_inside_it(count: int) -> None:
    nodes = TASK.start(1)
    x = TASK.particles(nodes, count)
    beans = nodes.reshape(-1, 2, 3)
    depth = np.stack([in_bean(x, bean) for bean in beans])
    # The cylinder of the same volume reaches 1.3 mm beyond the round ends' middles, at its edges outside them.
    assert depth.min(axis=0).max() < 0.0025
    owned = np.bincount(depth.argmin(axis=0), minlength=len(beans))
    assert owned.min() >= count // BEANS.count
    assert owned.max() <= -(-count // BEANS.count)
    middles = beans.mean(axis=1)
    assert np.linalg.norm(x[:, None] - middles, axis=-1).min(axis=0).max() < 0.008


def test_fewer_particles_than_beans_are_refused() -> None:
    with pytest.raises(ValueError, match="cannot be 49 particles"):
        TASK.particles(TASK.start(0), 49)


def test_the_goal_fills_its_disc_evenly_within_the_mat() -> None:
    goal = TASK.goal(0, 300)
    radius = np.linalg.norm(goal[:, :2] - MAT.place_m, axis=1)
    assert radius.max() < MAT.radius_m - BEANS.radius_m
    assert np.mean(radius < PROBLEMS.goal_m / np.sqrt(2)) == pytest.approx(0.5, abs=0.02)
    assert goal[:, 2].min() >= 0


def test_beans_that_do_not_fit_are_refused_with_what_to_widen() -> None:
    crowd = replace(PROBLEMS, beans=replace(BEANS, count=2000))
    with pytest.raises(ValueError, match=r"No room for 2000 beans.*widen"):
        crowd.start(0)
    with pytest.raises(ValueError, match="No place for a spill"):
        replace(PROBLEMS, distance_m=(2.0, 2.1)).start(0)


def test_the_aim_counts_what_lies_on_the_mat() -> None:
    aim = OnMat(mat=MAT, enough=0.75)
    x = np.zeros((4, 3), np.float32)
    x[:, :2] = np.array(MAT.place_m) + np.array([[0, 0], [0.079, 0], [0, -0.079], [0.09, 0]])
    assert aim.share(x, x) == 0.75
    assert aim.is_reached(x, x)
    assert not replace(aim, enough=0.8).is_reached(x, x)


def test_sweeping_ends_only_when_cameras_see_more_on_the_mat_than_the_aim_asks() -> None:
    goal = TASK.goal(0, 300)
    some_off, nearly_none = goal.copy(), goal.copy()
    some_off[:21, :2] += 0.2
    nearly_none[:5, :2] += 0.2
    assert TASK.success.is_reached(some_off, goal)
    assert not TASK.has_ended(some_off, goal)
    assert TASK.has_ended(nearly_none, goal)
    assert replace(TASK, stop_when=None).has_ended(some_off, goal)
