"""Cloths on the table and over the rack, and when a cloth is said to hang."""

import jax.numpy as jnp
import numpy as np
import pytest

from app.calibration.calibrate import phi_of
from app.core.motion import pointing_down
from app.jobs.jit_cache import action_simulator
from app.jobs.worker_api import nominal_model
from app.planner.actions.carry_actions import Carries
from app.tasks import load
from app.tasks.elements.sheets import ClothProblems
from app.tasks.elements.success import Hung

TASK = load("cloth_hang")
PROBLEMS, AIM = TASK.problems, TASK.success
assert isinstance(PROBLEMS, ClothProblems)
assert isinstance(AIM, Hung)
SIDE, SIZE_M, RACK = PROBLEMS.cloth.nodes_a_side, PROBLEMS.cloth.size_m, PROBLEMS.rack
GOAL = TASK.goal(0, 256)
PHI = jnp.asarray(phi_of(nominal_model(TASK.name)))[None]


@pytest.mark.parametrize("seed", range(10))
def test_a_cloth_starts_flat_whole_and_where_the_gripper_can_take_its_edge(seed: int) -> None:
    knots = TASK.start(seed).reshape(SIDE, SIDE, 3)
    for axis in (0, 1):
        sides = np.linalg.norm(np.diff(knots, axis=axis), axis=-1)
        assert sides == pytest.approx(np.full_like(sides, SIZE_M / (SIDE - 1)))
    assert np.ptp(knots[..., 2]) == 0
    x, y, _ = knots.reshape(-1, 3).T
    assert 0.2 < x.min() < x.max() < 0.9
    assert -0.40 < y.min() < y.max() < RACK.place_m[1] - RACK.spacing_m / 2 - RACK.radius_m


def test_seeds_differ_and_repeat() -> None:
    assert np.array_equal(TASK.start(3), TASK.start(3))
    assert np.abs(TASK.start(3) - TASK.start(4)).max() > 0.01


def test_the_goal_hangs_on_both_sides_of_the_rods_and_outside_of_them() -> None:
    assert AIM.is_reached(GOAL, GOAL)
    assert AIM.share(GOAL, GOAL) == 1.0
    x, y, z = GOAL.T.astype(np.float64)
    assert np.mean(y < RACK.place_m[1]) == pytest.approx(0.5, abs=0.03)
    for begin, _ in RACK.ends_m():
        # A particle is the mean of a patch, which about a rod lies inside its bend by up to 2 mm.
        assert np.hypot(y - begin[1], z - begin[2]).min() > RACK.radius_m - 0.002
    assert np.ptp(x) == pytest.approx(SIZE_M, abs=0.02)
    # Its sides hang down as far as what is not above the rods allows.
    level_m = RACK.spacing_m + np.pi * (RACK.radius_m + 0.002)
    assert RACK.place_m[2] - z.min() == pytest.approx((SIZE_M - level_m) / 2, abs=0.01)


def test_a_cloth_of_which_a_part_lies_on_the_table_or_hangs_from_one_side_or_far_off_is_not_hung() -> None:
    fallen, aside, drawn = (GOAL.copy() for _ in range(3))
    fallen[:40, 2] = 0.0
    aside[:, 1] = RACK.place_m[1] + np.abs(aside[:, 1] - RACK.place_m[1])
    drawn[:40, 1] = RACK.place_m[1] + 0.15
    assert not any(AIM.is_reached(x, GOAL) for x in (fallen, aside, drawn))
    assert AIM.share(fallen, GOAL) == pytest.approx(1 - 40 / 256)


def test_a_cloth_that_the_gripper_may_hold_is_not_done() -> None:
    hand = pointing_down(np.array([0.55, 0.22, 0.16]))
    for opening_m, done in ((0.004, False), (0.040, True)):
        hand[7] = opening_m
        assert TASK.is_done(GOAL, GOAL, hand) is done
        assert TASK.has_ended(GOAL, GOAL, hand) is done


def test_particles_of_a_world_are_evenly_spread_over_its_mesh() -> None:
    x = TASK.particles(TASK.start(0), 256)
    knots = TASK.start(0)
    assert x.shape == (256, 3)
    away = np.linalg.norm(knots[:, None] - x, axis=-1)
    assert away.min(1).max() < 0.02
    near = np.sort(np.linalg.norm(x[:, None] - x, axis=-1), axis=1)[:, 1]
    assert near.min() > 0.5 * SIZE_M / 16


@pytest.mark.parametrize("aside_m", [0.0, 0.01, 0.02])
def test_a_cloth_that_hangs_from_the_gripper_stays_whole(aside_m: float) -> None:
    """Wherever the grid's nodes are: what a planner takes to tear off, it will take elsewhere."""
    assert isinstance(TASK.actions, Carries)
    low_m, high_m, lifting, hanging = 0.006, 0.32, 660, 1000
    x = TASK.particles(TASK.start(0), 256) + np.float32([aside_m, 0.0, 0.0])
    middle = x[np.abs(x[:, 0] - x[:, 0].mean()) < 0.02]
    edge = middle[np.argmax(middle[:, 1])] - np.float32([0.0, 0.012, 0.0])
    path = np.zeros((1, lifting + hanging + 1, 8), np.float32)
    path[..., :2], path[..., 3], path[..., 7] = edge[:2], 1.0, TASK.actions.openings_m[0]
    path[0, :, 2] = np.interp(np.arange(path.shape[1]), [0, lifting], [low_m, high_m])
    end = np.asarray(
        action_simulator(TASK.name, 256)(PHI, TASK.initial_state(jnp.asarray(x)[None]), jnp.asarray(path)).x[0]
    )
    below_m = high_m - end[:, 2]
    assert below_m.max() < 1.1 * SIZE_M
    assert np.diff(np.sort(below_m)).max() < 1.5 * SIZE_M / 16
