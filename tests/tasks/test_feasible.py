"""A goal that cannot be reached is refused with the file, the place and the bounds; every task's own goals can be."""

import numpy as np
import pytest

from app.core.errors import UsageError
from app.core.geometry.shapes.fixtures import Bowl, Mat, Obstacle, Rack
from app.tasks import load, names
from app.tasks.elements.feasible import check_goal

FIXTURES = {
    "block": (Obstacle(half_m=(0.1, 0.02, 0.03), place_m=(0.5, 0.0, 0.03)), (0.45, 0.0, 0.03), (0.45, 0.03, 0.03)),
    "bowl": (
        Bowl(radius_m=0.06, thickness_m=0.008, place_m=(0.5, 0.0, 0.08), friction=0.1),
        (0.5, 0.0, 0.016),
        (0.5, 0.0, 0.144),
    ),
    "rack": (
        Rack(count=2, spacing_m=0.04, half_length_m=0.1, radius_m=0.01, place_m=(0.5, 0.0, 0.2)),
        (0.55, 0.02, 0.2),
        (0.55, 0.0, 0.2),
    ),
}


@pytest.mark.parametrize("name", FIXTURES)
def test_points_in_the_matter_of_a_fixture_are_inside_and_those_in_its_hollows_are_not(name: str) -> None:
    fixture, solid, hollow = FIXTURES[name]
    points = np.array([solid, hollow], np.float32)
    assert fixture.contains(points, 0.001).tolist() == [True, False]
    assert not fixture.contains(points, 1.0).any()


def test_nothing_is_inside_a_mark_on_the_table() -> None:
    assert not Mat(radius_m=0.1, place_m=(0.5, 0.0)).contains(np.float32([[0.5, 0.0, 0.0]]), 0.0).any()


@pytest.mark.parametrize("name", names())
def test_every_tasks_own_goals_are_within_reach(name: str) -> None:
    task = load(name)
    for seed in range(20):
        check_goal(task, task.goal(seed, 300), "goal")


@pytest.mark.parametrize("name", names())
def test_a_goal_out_of_reach_is_refused_with_its_name_its_middle_and_the_bounds(name: str) -> None:
    task = load(name)
    goal = task.goal(0, 300)
    for away in ([0.6, 0.0, 0.0], [0.0, -0.8, 0.0], [0.0, 0.0, 0.5]):
        far = (goal + np.float32(away)).astype(np.float32)
        with pytest.raises(UsageError, match=rf"^far.npy: its middle, .* is out of reach: {name} can bring"):
            check_goal(task, far, "far.npy")


def test_a_goal_that_goes_through_a_wall_is_refused_with_the_wall_and_the_first_point() -> None:
    task = load("rod_to_rope")
    wall = next(fixture for fixture in task.stage.fixtures if isinstance(fixture, Obstacle))
    goal = task.goal(0, 300).copy()
    goal[7] = wall.place_m
    with pytest.raises(
        UsageError, match=r"wall.npy: 1 of 300 points are inside the obstacle of rod_to_rope, the first at"
    ):
        check_goal(task, goal, "wall.npy")
