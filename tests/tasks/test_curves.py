"""Starts, goals and particles."""

import numpy as np
import pytest

from app.core.geometry.chamfer import chamfer_m2
from app.tasks import load
from app.tasks.elements.curves import CurveSampler, RopeProblems, fill_tube

TASK = load("rope_push")
assert isinstance(TASK.problems, RopeProblems)
PROBLEMS = TASK.problems.curves


@pytest.mark.parametrize("seed", range(12))
def test_start_and_goal_are_ropes_of_the_right_length_inside_the_workspace_and_within_reach(seed: int) -> None:
    for curve in PROBLEMS.draw(seed, TASK.rope):
        assert np.linalg.norm(np.diff(curve, axis=0), axis=1).sum() == pytest.approx(TASK.rope.length_m, rel=1e-3)
        assert PROBLEMS.workspace.contains(curve)
        np.testing.assert_allclose(curve[:, 2], TASK.rope.radius_m)
    start, goal = PROBLEMS.draw(seed, TASK.rope)
    low, high = PROBLEMS.gap_m
    assert low <= np.sqrt(chamfer_m2(start, goal) / 2) <= high
    assert np.linalg.norm(start.mean(0) - goal.mean(0)) <= PROBLEMS.max_shift_m + 1e-9


def test_a_seed_names_one_problem() -> None:
    np.testing.assert_array_equal(TASK.start(3), TASK.start(3))
    np.testing.assert_array_equal(TASK.goal(3, 50), TASK.goal(3, 50))
    assert not np.allclose(TASK.start(3), TASK.start(4))


def test_a_problem_that_cannot_be_drawn_says_so() -> None:
    with pytest.raises(ValueError, match="No goal within reach"):
        CurveSampler(gap_m=(0.9, 1.0)).draw(0, TASK.rope)


def test_particles_fill_the_tube_evenly() -> None:
    line = np.stack([np.linspace(0, 0.4, 41), np.zeros(41), np.full(41, 0.008)], axis=1)
    x = fill_tube(line, 0.008, 2000)
    radius = np.hypot(x[:, 1], x[:, 2] - 0.008)
    assert radius.max() <= 0.008 + 1e-6
    assert (radius < 0.004).mean() == pytest.approx(0.25, abs=0.01)
    assert (x[:, 0] < 0.1).mean() == pytest.approx(0.25, abs=0.01)
