"""Filling a bowl to a mark: goals are of two pools, and what is in the wrong bowl costs its way to the other."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.config import Site
from app.core.geometry.chamfer import chamfer_m2
from app.planner.actions.mark_cost import ToMark
from app.planner.actions.pour_actions import Pours
from app.tasks import Task, load
from app.tasks.elements.filling import Filled, FillingProblems

COUNT = 300
filling = pytest.mark.parametrize("task", [load("pour_water-hard"), load("pour_soup-hard")], ids=lambda task: task.name)


def parts(task: Task) -> tuple[FillingProblems, Filled, ToMark]:
    assert isinstance(task.problems, FillingProblems)
    assert isinstance(task.success, Filled)
    assert isinstance(task.weights.distance, ToMark)
    return task.problems, task.success, task.weights.distance


@filling
def test_goals_hold_all_the_liquid_in_two_bowls_by_seed(task: Task) -> None:
    problems, success, _ = parts(task)
    shares = [success.bowl.share(task.goal(seed, COUNT)) for seed in range(12)]
    low, high = problems.marks
    assert all(low - 1 / COUNT <= share <= high + 1 / COUNT for share in shares)
    assert len(set(shares)) > 6
    assert task.goal(0, COUNT).shape == (COUNT, 3)


@filling
def test_plans_wait_for_what_still_flows_as_long_as_the_cell_does(task: Task) -> None:
    assert isinstance(task.actions, Pours)
    waited_s = task.actions.rest_substeps * task.scene.dt_s
    assert waited_s == pytest.approx(task.stage.settle_s, abs=task.scene.dt_s)
    assert waited_s > Site().timing.settle_s


@filling
def test_too_much_is_as_wrong_as_too_little(task: Task) -> None:
    problems, success, _ = parts(task)
    goal = task.goal(0, COUNT)
    wanted, off = success.bowl.share(goal), success.within
    for share, right in ((wanted - off - 0.02, False), (wanted - off + 0.02, True), (wanted + off - 0.02, True)):
        assert success.is_reached(problems.pools(share, COUNT), goal) is right
    too_much = problems.pools(wanted + 2 * off, COUNT)
    assert not success.is_reached(too_much, goal)
    assert success.share(too_much, goal) == pytest.approx(1 - 2 * off / wanted, abs=2 / COUNT / wanted)
    assert success.share(task.particles(task.start(0), COUNT), goal) == 0.0


@filling
def test_what_is_in_the_wrong_bowl_costs_the_way_between_them(task: Task) -> None:
    problems, success, distance = parts(task)
    goal = task.goal(0, COUNT)
    wanted = success.bowl.share(goal)
    at = [wanted - 0.2, wanted - 0.1, wanted, wanted + 0.1]
    x = jnp.asarray(np.stack([problems.pools(share, COUNT) for share in at]))
    exact = replace(distance, below=0.0)
    cost_m2, chamfer = np.asarray(exact(x, jnp.asarray(goal))), np.asarray(chamfer_m2(x, jnp.asarray(goal)[None]))
    # Soft borders count what is near the wall and the rim as partly outside.
    np.testing.assert_allclose(
        (cost_m2 - chamfer) / distance.apart_m**2, [0.2, 0.1, 0.0, 0.1], rtol=0.3, atol=1 / COUNT
    )
    assert cost_m2.argmin() == 2
    assert (chamfer[[1, 3]] < 0.1 * distance.apart_m**2).all()


@filling
def test_plans_for_water_aim_below_the_mark_by_less_than_counts_as_filled_and_for_soup_at_it(task: Task) -> None:
    problems, success, distance = parts(task)
    goal = task.goal(0, COUNT)
    wanted = success.bowl.share(goal)
    at = wanted + np.arange(-0.08, 0.081, 0.01)
    x = jnp.asarray(np.stack([problems.pools(share, COUNT) for share in at]))
    aimed = float(at[np.asarray(distance(x, jnp.asarray(goal))).argmin()])
    below = wanted - aimed
    assert 0.01 < below < success.within if task.name.startswith("pour_water") else abs(below) < 0.01
    assert success.is_reached(problems.pools(aimed, COUNT), goal)
    assert isinstance(task.stop_when, Filled)
    assert task.stop_when.is_reached(problems.pools(aimed, COUNT), goal)


@filling
def test_its_slopes_are_those_of_differences(task: Task) -> None:
    problems, success, distance = parts(task)
    goal = jnp.asarray(task.goal(0, COUNT))
    x = jnp.asarray(problems.pools(success.bowl.share(np.asarray(goal)) + 0.15, COUNT))
    up = jnp.zeros_like(x).at[:, 2].set(jnp.where(x[:, 0] > problems.target.place_m[0] - 0.04, 1.0, 0.0))

    def raised(height_m: jnp.ndarray) -> jnp.ndarray:
        return distance((x + height_m * up)[None], goal)[0]

    slope, step = float(jax.grad(raised)(jnp.float32(0.0))), 5e-4
    between = float(raised(jnp.float32(step)) - raised(jnp.float32(-step)))
    assert slope == pytest.approx(between / (2 * step), rel=0.05)
    amounts = [float(distance.bowl.soft_share((x + height * up)[None])[0]) for height in (0.0, 0.02)]
    assert amounts[1] < amounts[0]
