"""Splits of a task's problems: hard ones are other problems with the same object and tool, and easy ones stay."""

from dataclasses import replace

import numpy as np
import pytest

from app.config import Site
from app.core.errors import UsageError
from app.tasks import Task, load, names
from app.tasks.elements.feasible import check_goal
from app.tasks.elements.splits import with_problems

TASKS = [name for name in names() if load(name).hard]
COUNT, ENOUGH = 120, 300
"""Particles; so many that their means lie in a cloth's bends as near to its surface as fixtures are asked."""


def hard(name: str) -> Task:
    return load(f"{name}-hard")


def fingerprint(points: np.ndarray) -> float:
    """A number [m] that changes with place and extent along each axis, and little with how points are spread evenly."""
    return float(np.r_[points.mean(0, np.float64), points.std(0, np.float64)] @ (1.0, 0.9, 0.8, 0.7, 0.6, 0.5))


@pytest.mark.parametrize("name", TASKS)
def test_hard_problems_have_the_object_and_the_tool_of_the_easy_ones(name: str) -> None:
    easy, other = load(name), hard(name)
    assert other.name == f"{name}-hard"
    assert (other.stage.body, other.stage.tool) == (easy.stage.body, easy.stage.tool)
    assert (other.nominal, other.calibrated, other.parameters()) == (easy.nominal, easy.calibrated, easy.parameters())
    assert other.problem == name


@pytest.mark.parametrize("name", TASKS)
def test_the_first_30_hard_problems_are_their_seeds_inside_the_workspace_and_feasible(name: str) -> None:
    task, box = hard(name), Site().limits.workspace
    low, high = np.array([*box.low[:2], 0.0]), np.array(box.high)
    np.testing.assert_array_equal(task.start(7), task.start(7))
    np.testing.assert_array_equal(task.goal(7, ENOUGH), task.goal(7, ENOUGH))
    assert not np.array_equal(task.start(7), load(name).start(7)) or task.stage != load(name).stage
    for seed in range(30):
        start, goal = task.start(seed), task.goal(seed, ENOUGH)
        x = task.particles(start, ENOUGH)
        for points in (start, x, goal):
            assert (points >= low).all()
            assert (points <= high).all()
        for fixture in task.stage.fixtures:
            assert not fixture.contains(x, 0.0).any()
        check_goal(task, goal, "goal")
        assert not task.success.is_reached(x, goal)
        assert task.success.is_reached(goal, goal)


def test_a_hard_problem_has_any_sizes_and_dynamics_of_its_task() -> None:
    task = load("rope_push-hard(length_m=0.3)@rods")
    assert task.dynamics == "rods"
    assert task.rope.length_m == 0.3
    assert task.recorded_name == "rope_push-hard(length_m=0.3)"
    assert np.linalg.norm(np.diff(task.start(0), axis=0), axis=1).sum() == pytest.approx(0.3, rel=1e-3)
    assert load(task.name) is task


def test_a_task_without_hard_problems_says_so_in_one_line() -> None:
    without = replace(load("rope_push"), hard=None)
    assert with_problems(without, "easy") is without
    with pytest.raises(UsageError, match="rope_push has no hard problems; leave --problems out") as refused:
        with_problems(without, "hard")
    assert "\n" not in str(refused.value)


EASY = {
    "bean_sweep": (0.703792, 0.597695, 0.776479, 0.597695),
    "cloth_hang": (0.502545, 0.855214, 0.523708, 0.855214),
    "pour_soup": (0.540532, 0.599708, 0.545885, 0.600858),
    "pour_water": (0.540787, 0.598430, 0.546067, 0.598430),
    "rod_to_rope": (0.480232, 0.807855, 0.531026, 0.801688),
    "rope_push": (0.728618, 0.567374, 0.580510, 0.502503),
}
"""Fingerprints of start and goal of seeds 0 and 7 before there were hard problems."""


@pytest.mark.parametrize("name", sorted(EASY))
def test_easy_problems_are_what_they_were_before_there_were_hard_ones(name: str) -> None:
    task = load(name)
    found = [fingerprint(points) for seed in (0, 7) for points in (task.start(seed), task.goal(seed, COUNT))]
    np.testing.assert_allclose(found, EASY[name], rtol=0, atol=2e-5)
