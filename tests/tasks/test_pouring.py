"""Tasks of pouring: starts and goals are liquids at rest, and one count of particles is split alike by everybody."""

import numpy as np
import pytest
from scipy.spatial import KDTree

from app.core.geometry.bowls import centre_of_bowl
from app.core.geometry.scene_description import Soup
from app.core.geometry.shapes.fixtures import Bowl
from app.core.geometry.shapes.tools import HeldBowl
from app.tasks import Task, load

pouring = pytest.mark.parametrize("task", [load("pour_water"), load("pour_soup")], ids=lambda task: task.name)


def bowls(task: Task) -> tuple[HeldBowl, Bowl]:
    held, (target,) = task.stage.tool, task.stage.fixtures
    assert isinstance(held, HeldBowl)
    assert isinstance(target, Bowl)
    return held, target


@pouring
def test_all_of_the_goal_and_nothing_of_the_start_is_in_the_target_bowl(task: Task) -> None:
    goal = task.goal(0, 300)
    assert task.success.share(goal, goal) == 1.0
    start = task.start(0).astype(np.float32)
    assert task.success.share(start, start) == 0.0


@pouring
def test_the_start_is_level_in_a_bowl_a_little_aside_by_seed(task: Task) -> None:
    held, _ = bowls(task)
    for seed in range(3):
        x = task.start(seed)
        middle = centre_of_bowl(x, held.radius_m, task.stage.body.volume_m3)
        assert np.linalg.norm(x - middle, axis=1).max() < held.radius_m + 1e-3
        assert np.abs(middle - task.problems.home_m)[:2].max() < 0.042
        np.testing.assert_array_equal(x, task.start(seed))


@pouring
def test_particles_are_the_world_s_fewer_and_in_its_place(task: Task) -> None:
    nodes = task.start(1)
    x = task.particles(nodes, 300)
    assert x.shape == (300, 3)
    np.testing.assert_allclose(x.mean(axis=0), nodes.mean(axis=0), atol=1e-3)
    assert KDTree(x).query(nodes)[0].max() < 0.008


@pouring
@pytest.mark.parametrize("count", [100, 299, 300, 1000])
def test_scene_and_perception_split_particles_alike(task: Task, count: int) -> None:
    swimming = task.perception.swimming
    assert task.scene.split(count) == ((count,) if swimming is None else swimming.split(count))


def test_pieces_of_a_soup_begin_apart_and_under_its_surface() -> None:
    task = load("pour_soup")
    soup = task.stage.body
    assert isinstance(soup, Soup)
    for seed in range(5):
        x = task.start(seed)
        liquid, pieces = x[: soup.liquid.drops], x[soup.liquid.drops :].reshape(6, -1, 3)
        assert pieces[..., 2].max() < liquid[:, 2].max() + 1e-3
        near = [KDTree(one.reshape(-1, 3)).query(liquid)[0].min() for one in pieces]
        assert min(near) > 0.0015
        for first in range(6):
            others = np.concatenate([pieces[k] for k in range(6) if k != first])
            assert KDTree(others).query(pieces[first])[0].min() > 0.0035
