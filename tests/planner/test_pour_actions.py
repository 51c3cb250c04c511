"""Pours: a held bowl goes and turns where it may, as the arm does it."""

from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial.transform import Rotation

from app.arm.path import PathFollower, route
from app.config import Site
from app.core.motion import pointing_down
from app.jobs import jit_cache
from app.planner.actions.pour_actions import from_upright, tilt
from app.planner.search.request import PlanRequest
from app.planner.search.rollout_frames import grow
from app.planner.search.tree import TreeConfig, own_branches, start, state_after
from app.policy.base import PlanningState
from app.tasks import load

SPACE = load("pour_water").actions
LOW, HIGH = np.array(SPACE.low), np.array(SPACE.high)
SEEDS = st.integers(0, 2**31 - 1)
project, allowed = jax.jit(SPACE.project), jax.jit(SPACE.is_allowed)


SHIFT = np.array([0.12, 0.0, 0.0, 0.0, 0.0, 0.0], np.float32)
TILT = np.array([0.0, 0.0, 0.0, 0.0, 0.28, 0.0], np.float32)


def tool(rng: np.random.Generator) -> np.ndarray:
    """A bowl somewhere in the box, tilted by up to the limit."""
    axis = rng.standard_normal(3) * [1, 1, 0]
    turn = Rotation.from_rotvec(rng.uniform(0, SPACE.max_tilt_rad) * axis / np.linalg.norm(axis))
    pose = pointing_down(rng.uniform(LOW, HIGH))
    pose[3:7] = (turn * Rotation.from_quat(pose[3:7], scalar_first=True)).as_quat(scalar_first=True)
    return pose


def situation(seed: int, count: int = 16) -> tuple[PlanningState, jnp.ndarray]:
    """A bowl, and wild actions of it."""
    rng = np.random.default_rng(seed)
    now = PlanningState.at_rest(jnp.zeros((count, 1, 3)), tool(rng))
    return now, jnp.asarray(rng.normal(0, [0.1] * 3 + [0.5] * 3, (count, 6)), jnp.float32)


@settings(max_examples=20)
@given(SEEDS)
def test_projected_pours_end_in_the_box_and_tilt_no_further_than_allowed(seed: int) -> None:
    now, wild = situation(seed)
    pours = project(wild, now)
    end = np.asarray(SPACE.after(pours, now.tool))
    assert np.all(allowed(pours, now))
    assert np.all((end[:, :3] > LOW - 1e-4) & (end[:, :3] < HIGH + 1e-4))
    assert np.linalg.norm(pours[:, 3:], axis=1).max() <= SPACE.max_turn_rad + 1e-5
    # A share of a turn that swings the axis sideways is not quite a share of its tilt.
    assert np.asarray(tilt(jnp.asarray(end[:, 3:7]))).max() < SPACE.max_tilt_rad + 0.03


@settings(max_examples=20)
@given(SEEDS)
def test_a_path_goes_from_where_the_tool_is_to_where_the_next_action_begins(seed: int) -> None:
    now, wild = situation(seed)
    pours = project(wild, now)
    path, end = np.asarray(SPACE.tool_path(pours, now.tool)), SPACE.after(pours, now.tool)
    assert path.shape == (16, SPACE.substeps + 1, 7)
    np.testing.assert_allclose(path[:, 0, :3], now.tool[:, :3], atol=1e-6)
    np.testing.assert_allclose(path[:, -1, :3], end[:, :3], atol=1e-6)
    np.testing.assert_allclose(path[:, 0, 3:], from_upright(now.tool[:, 3:7]), atol=1e-5)
    np.testing.assert_allclose(path[:, -1, 3:], from_upright(end[:, 3:7]), atol=1e-5)
    np.testing.assert_allclose(np.linalg.norm(path[..., 3:], axis=-1), 1.0, atol=1e-5)


@settings(max_examples=20)
@given(SEEDS)
def test_what_the_arm_is_told_and_then_measured_to_do_is_what_was_simulated(seed: int) -> None:
    now, wild = situation(seed, count=1)
    pours = project(wild, now)
    pose = np.asarray(now.tool[0], np.float64)
    motion = SPACE.motion(np.asarray(pours[0]), pose, Site())
    assert motion.continues
    np.testing.assert_allclose(motion.positions[0], pose[:3], atol=1e-9)
    path = np.asarray(SPACE.tool_path(pours, now.tool))[0]
    measured = SPACE.measured_path(motion.poses)
    side = np.sign((measured[:, 3:] * path[:, 3:]).sum(1, keepdims=True))
    np.testing.assert_allclose(measured[:, :3], path[:, :3], atol=2e-4)
    np.testing.assert_allclose(side * measured[:, 3:], path[:, 3:], atol=2e-3)


@pytest.mark.parametrize(
    ("action", "ahead_m", "ahead_rad"), [(SHIFT, 0.004, 0.0), (TILT, 0.0, 0.05)], ids=["shift", "tilt"]
)
def test_a_motion_is_simulated_as_the_arm_makes_it_in_time(
    action: np.ndarray, ahead_m: float, ahead_rad: float
) -> None:
    """The profile is the longest shift's; a tilt the arm makes a little sooner."""
    pose, site, period_s = pointing_down(np.array([0.4, 0.0, 0.2])), Site(), load("pour_water").scene.dt_s
    now = PlanningState.at_rest(jnp.zeros((1, 1, 3)), pose)
    path = np.asarray(SPACE.tool_path(jnp.asarray(action[None]), now.tool))[0]
    arm = PathFollower(*route(pose, SPACE.motion(action, pose, site), site), site.limits.acceleration_m_s2)
    made = np.stack([pose, *(arm.advance(period_s) for _ in range(SPACE.move_substeps))])
    simulated = path[: len(made)]
    assert np.linalg.norm(made[:, :3] - simulated[:, :3], axis=1).max() <= ahead_m + 1e-4
    turns = (np.asarray(from_upright(jnp.asarray(made[:, 3:7]))), simulated[:, 3:])
    leans = [2 * np.arccos(np.minimum(np.abs(turn[:, 0]), 1.0)) for turn in turns]
    assert np.abs(leans[0] - leans[1]).max() <= ahead_rad + 1e-3


def test_a_bowl_on_a_tool_that_points_down_is_upright() -> None:
    assert float(tilt(jnp.asarray(pointing_down(np.zeros(3))[3:7]))) < 1e-6


def test_the_way_depends_smoothly_on_every_number_of_an_action() -> None:
    now, wild = situation(0, count=1)

    def last(action: jnp.ndarray) -> jnp.ndarray:
        return SPACE.tool_path(action, now.tool)[0, -1].sum()

    slope = np.asarray(jax.grad(last)(wild))[0]
    for number in range(6):
        step = jnp.zeros_like(wild).at[0, number].set(1e-3)
        numeric = float(last(wild + step) - last(wild - step)) / 2e-3
        assert abs(numeric - slope[number]) < 2e-3


def parts(**changes: object) -> tuple[TreeConfig, PlanRequest]:
    """The tree of a pour, whose liquid stays where it is."""
    task, phi = load("pour_water-hard"), jit_cache.phi_of(jit_cache.nominal_model("pour_water-hard"))
    tree = jit_cache.search("pour_water-hard", "cpu", phi)
    x, place = task.particles(task.start(0), 300), pointing_down(np.array([0.45, 0.02, 0.2]))
    asked = PlanRequest(observed=x, goal=task.goal(0, 300), phi=phi, tool=place, seed=3)
    return replace(tree, advance=lambda phi, state, path: state, part=None, **changes), asked


def test_branches_make_parts_of_what_the_policy_does_at_every_step() -> None:
    tree, asked = parts(policy_shares=(0.25, 0.5), branches=5)
    begun = start(tree, asked)
    np.testing.assert_allclose(begun.first[1:3], np.outer([0.25, 0.5], begun.first[0]), atol=1e-6)
    actions = grow(tree, begun, jnp.asarray(asked.goal)).rollout.actions
    then = state_after(tree, begun.phi, begun.now, actions[:, 0])
    acted = tree.policy.act(begun.prepared, then).mean
    wanted = np.array([1.0, 0.25, 0.5, 1.0, 1.0])[:, None] * acted
    np.testing.assert_allclose(actions[:, 1], tree.space.project(jnp.asarray(wanted, jnp.float32), then), atol=1e-6)


@pytest.mark.parametrize(("branches", "own"), [(1, 1), (2, 1), (3, 2), (8, 3)])
def test_one_branch_is_left_for_the_remainder_and_without_a_policy_there_are_no_parts(branches: int, own: int) -> None:
    tree, asked = parts(policy_shares=(0.25, 0.5), branches=branches)
    first = np.asarray(start(tree, asked).first)
    along = np.abs(np.cross(first[:, :3], first[:1, :3])).max(axis=1) < 1e-6
    assert along.sum() == own
    assert own_branches(tree)[:own].all()
    assert own_branches(tree).sum() == min(own + 1, branches)
    assert np.asarray(start(replace(tree, guided=False), asked).shares).tolist() == [1.0] * branches
