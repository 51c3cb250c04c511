"""The scripted policy: to the cloth's edge, up with it, over the rack, down beyond it, off; it alone hangs cloths."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.config import Site
from app.core.motion import pointing_down
from app.core.types import Points, ToolPose
from app.planner.actions.carry_actions import Carries
from app.policy.base import PlanningState
from app.policy.scripted_carry import ScriptedCarry
from app.rig.simulated.lockstep import LockStep
from app.tasks import load
from bench.approval import approved

TASK = load("cloth_hang")
POLICY, SPACE = TASK.policy, TASK.actions
assert isinstance(POLICY, ScriptedCarry)
assert isinstance(SPACE, Carries)
CLOSED_M, OPEN_M = SPACE.openings_m
GOAL = TASK.goal(0, 256)
act, project = jax.jit(lambda prepared, now: POLICY.act(prepared, now).mean), jax.jit(SPACE.project)


def hand(x_m: float, y_m: float, z_m: float, opening_m: float) -> ToolPose:
    pose = pointing_down(np.array([x_m, y_m, z_m]))
    pose[7] = opening_m
    return pose


def action(x: Points, tool: ToolPose) -> np.ndarray:
    here = PlanningState.at_rest(jnp.asarray(x)[None], tool)
    return np.asarray(project(act(POLICY.prepare(x, GOAL), here), here))[0]


def way(x: Points, tool: ToolPose) -> np.ndarray:
    """Ends of the moves of an action (8, 4): x, y, z and opening."""
    moves = action(x, tool).reshape(8, 4)
    return np.concatenate([tool[:3] + np.cumsum(moves[:, :3], axis=0), moves[:, 3:]], axis=1)


def lying(seed: int) -> Points:
    return TASK.particles(TASK.start(seed), 256)


def hanging(x_m: float, y_m: float, z_m: float) -> Points:
    """A cloth that hangs straight down from this place."""
    across, down = np.meshgrid(np.linspace(-0.12, 0.12, 16), np.linspace(0.0, 0.24, 16), indexing="ij")
    return np.stack([x_m + across.ravel(), np.full(256, y_m), z_m - down.ravel()], axis=1).astype(np.float32)


@pytest.mark.parametrize("seed", range(4))
def test_it_comes_down_open_on_the_edge_towards_the_rack_closes_there_and_goes_up(seed: int) -> None:
    x, tool = lying(seed), hand(0.30, 0.0, 0.30, 0.0)
    ends = list[np.ndarray]()
    for _ in range(4):
        ends += list(way(x, tool))
        tool = hand(*ends[-1])
        if tool[7] < 0.01 and len(ends) > 8:
            break
    steps = np.array(ends)
    first = int(np.argmax((steps[:, 3] < 0.01) & (steps[:, 2] < 0.01)))
    taken = steps[first]
    assert taken[2] == pytest.approx(POLICY.low_m, abs=1e-4)
    near = x[np.linalg.norm(x[:, :2] - taken[:2], axis=1) < 0.03]
    assert len(near) > 3
    # On the line through the middle, and little of the cloth is nearer to the rack there.
    assert taken[0] == pytest.approx(x[:, 0].mean(), abs=0.005)
    strip = x[np.abs(x[:, 0] - taken[0]) < 0.015]
    assert np.mean(strip[:, 1] > taken[1]) < 0.25
    assert steps[:first, 3][steps[:first, 2] < 0.07] == pytest.approx(OPEN_M, abs=1e-4)
    assert way(x, hand(*taken))[-1, 2] > 0.15


def test_what_is_held_goes_up_and_over_the_rack_to_its_far_side_and_is_let_go_there() -> None:
    x_m, y_m, z_m = 0.50, -0.06, 0.25
    tool = hand(x_m, y_m, z_m, CLOSED_M)
    steps = list[np.ndarray]()
    for _ in range(4):
        # The cloth goes with the gripper, and stays over the rack once it is drawn across.
        x = hanging(*tool[:3])
        x[:, 1] = np.where(x[:, 2] < 0.15, np.minimum(x[:, 1], 0.05), x[:, 1])
        steps += list(way(x, tool))
        tool = hand(*steps[-1])
        if tool[7] > 0.02:
            break
    ends = np.array(steps)
    let_go = int(np.argmax(ends[:, 3] > 0.02))
    assert let_go > 0
    assert ends[let_go, 1] == pytest.approx(POLICY.rack_y_m + POLICY.beyond_m, abs=0.005)
    assert ends[let_go, 2] == pytest.approx(POLICY.release_m, abs=0.005)
    over = np.abs(ends[:let_go, 1] - POLICY.rack_y_m) < POLICY.half_m - 0.02
    assert over.any()
    assert ends[:let_go][over, 2].min() > SPACE.clear.top_m


def test_it_leaves_a_cloth_alone_that_hangs() -> None:
    ends = way(GOAL, hand(0.55, 0.22, 0.16, OPEN_M))
    assert np.ptp(ends[:, 0]) < 1e-5
    assert np.ptp(ends[:, 1]) < 1e-5
    assert ends[-1, 2] > 0.30
    assert ends[:, 3] == pytest.approx(OPEN_M, abs=1e-5)


@pytest.mark.slow
def test_it_alone_hangs_a_cloth_in_the_simulated_cell() -> None:
    cell, site = LockStep(TASK.stage, TASK.start(0), Site(), 0), Site()
    for _ in range(12):
        x = TASK.particles(cell.nodes(), 256)
        if TASK.has_ended(x, GOAL, cell.tool):
            break
        cell.execute(approved(SPACE.motion(action(x, cell.tool), cell.tool, site), x))
    assert TASK.is_done(TASK.particles(cell.nodes(), 256), GOAL, cell.tool)


def test_open_fingers_that_have_come_down_close_where_they_are_though_they_hide_the_edge() -> None:
    x = lying(0)
    tool = hand(0.30, 0.0, 0.30, 0.0)
    for _ in range(4):
        tool = hand(*way(x, tool)[-1])
        if tool[2] < POLICY.low_m + 0.001:
            break
    left = x[np.abs(x[:, :2] - tool[:2]).max(1) > 0.025]
    seen = left[np.arange(len(x)) % len(left)]
    assert seen[np.abs(seen[:, 0] - tool[0]) < 0.02, 1].max() < tool[1] - 0.02
    closing = way(seen, hand(*tool[:3], OPEN_M))
    low = closing[:, 2] < POLICY.low_m + 0.001
    np.testing.assert_allclose(closing[low, :2], np.tile(tool[:2], (low.sum(), 1)), atol=1e-4)
    assert closing[low, 3].min() == pytest.approx(CLOSED_M)
