"""The scripted policy for a rod and a gap: it turns, aims and pushes through; and its rods do go through."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.types import Points
from app.evaluation.demonstrate import demonstrations
from app.policy.base import PlanningState
from app.policy.scripted_gap import fit_rods
from app.tasks import load
from app.tasks.elements.curves import fill_tube

TASK = load("rod_to_rope")
POLICY, SPACE = TASK.policy, TASK.actions
act = jax.jit(lambda prepared, now: POLICY.act(prepared, now).mean)


def rod(x: float, y: float, heading: float) -> Points:
    along = np.linspace(-0.12, 0.12, 41)
    curve = np.stack([x + along * np.cos(heading), y + along * np.sin(heading), np.full(41, 0.008)], axis=1)
    return fill_tube(curve, 0.008, 180)


def pushed(x: Points) -> np.ndarray:
    """The policy's push as waypoints (21, 2) [m]."""
    action = np.asarray(act(None, PlanningState.at_rest(jnp.asarray(x)[None])))[0]
    return action[:2] + np.concatenate([np.zeros((1, 2)), action[2:].reshape(-1, 2).cumsum(0)])


@pytest.mark.parametrize("heading", [-1.2, -0.3, 0.0, 0.5, 1.4])
def test_a_straight_rod_is_fitted_whatever_its_heading(heading: float) -> None:
    found = fit_rods(jnp.asarray(rod(0.45, 0.03, heading))[None, :, :2])
    assert float(found.heading[0]) == pytest.approx(heading, abs=0.01)
    np.testing.assert_allclose(found.middle[0], [0.45, 0.03], atol=1e-3)


def test_a_rod_that_leads_into_the_gap_is_pushed_along_itself_by_its_far_end() -> None:
    path = pushed(rod(0.42, 0.0, 0.0))
    assert path[0, 0] < 0.42 - 0.12 - SPACE.clearance_m
    assert np.abs(path[:, 1]).max() < 0.005
    assert POLICY.through_m < path[-1, 0] - path[0, 0] < 0.1


@pytest.mark.parametrize("heading", [1.0, -1.0])
def test_a_rod_across_the_gap_is_pushed_at_an_end_so_that_it_turns_towards_it(heading: float) -> None:
    x = rod(0.45, 0.0, heading)
    path, middle = pushed(x), np.array([0.45, 0.0])
    arm, push = path[0] - middle, path[-1] - path[0]
    assert np.linalg.norm(arm) > 0.06
    assert np.sign(arm[0] * push[1] - arm[1] * push[0]) == -np.sign(heading)


def test_a_rod_along_x_beside_the_gap_is_shifted_towards_it() -> None:
    path = pushed(rod(0.42, 0.10, 0.0))
    assert path[0, 1] > 0.10
    assert path[-1, 1] < path[0, 1] - 0.05


def test_rods_of_demonstrations_go_through() -> None:
    shown = list(demonstrations("rod_to_rope", "cpu", range(1000, 1002), "truth"))
    assert all(each.played.success and not each.played.failure for each in shown)
