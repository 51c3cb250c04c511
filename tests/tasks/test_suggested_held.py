"""A carry or a pour that discovery asks for goes on from where the tool is, turned as it is, in its own time."""

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.arm.timed_motion import motion_along
from app.config import Site
from app.core.errors import PlanningError
from app.core.geometry.bowls import centre_of_bowl
from app.core.geometry.scene_description import Liquid
from app.core.geometry.shapes.tools import HeldBowl
from app.core.motion import TOOL_DOWN, Motion, pointing_down
from app.core.types import Points, ToolPose
from app.jobs.discovery_subject import subject_of
from app.jobs.suggestions.held import begin_at, waits_for
from app.jobs.worker_api import nominal_model, plan_of_suggestion
from app.planner.actions.carry_actions import Carries
from app.planner.actions.pour_actions import Pours
from app.policy.random_carries import carry_design, random_carry
from app.policy.random_pours import beside, random_pour
from app.tasks import load

CLOTH, WATER, SITE = load("cloth_hang"), load("pour_water"), Site()
CARRIES = CLOTH.actions
assert isinstance(CARRIES, Carries)
POURS = WATER.actions
assert isinstance(POURS, Pours)
BOWLS = subject_of(WATER).bowls
assert BOWLS is not None
LIQUID = WATER.stage.body
assert isinstance(LIQUID, Liquid)
AT = np.array([0.55, -0.16, 0.25])


def carry(seed: int) -> Motion:
    start = np.array([*AT, *TOOL_DOWN, 0.004])
    drawn = random_carry(np.random.default_rng(seed), start, carry_design(1, 1), start_s=5.0, closed_m=0.004)
    return motion_along(drawn, SITE)


def pour(seed: int) -> Motion:
    start = np.array([*beside(BOWLS.place_m[:2], np.pi), POURS.low[2] + 0.01])
    drawn = random_pour(
        np.random.default_rng(seed), start, BOWLS.place_m[:2], volume_m3=BOWLS.volume_m3, radius_m=BOWLS.held_radius_m
    )
    return motion_along(drawn.track(start_s=5.0), SITE)


def gripper(shift_m: tuple[float, float, float], yaw: float, opening_m: float = 0.003) -> ToolPose:
    turn = Rotation.from_euler("z", yaw) * Rotation.from_quat(TOOL_DOWN, scalar_first=True)
    return np.array([*(AT + shift_m), *turn.as_quat(scalar_first=True), opening_m])


def hanging(count: int = 256) -> Points:
    """A cloth that hangs from the gripper."""
    rng = np.random.default_rng(0)
    u, z = rng.uniform(-0.06, 0.06, count), rng.uniform(-0.01, 0.2, count)
    return (AT + np.stack([u, np.zeros(count), -z], axis=1)).astype(np.float32)


@pytest.mark.parametrize("yaw", [0.0, 0.4])
@pytest.mark.parametrize("seed", range(3))
def test_a_carry_begins_at_the_gripper_and_is_turned_with_it(seed: int, yaw: float) -> None:
    asked, tool = carry(seed), gripper((0.01, -0.02, 0.01), yaw)
    made = begin_at(asked, tool, CARRIES, None)
    assert isinstance(made, Motion)
    np.testing.assert_allclose(made.poses[0, [0, 1, 2, 7]], tool[[0, 1, 2, 7]], atol=1e-9)
    assert abs(made.turns[0] @ tool[3:7]) == pytest.approx(1.0)
    np.testing.assert_allclose(
        np.diff(made.positions, axis=0),
        Rotation.from_euler("z", yaw).apply(np.diff(asked.positions, axis=0)),
        atol=1e-9,
    )
    np.testing.assert_array_equal(made.speeds, asked.speeds)
    assert made.continues


def test_a_carry_that_would_leave_the_workspace_says_where_it_was_drawn_for() -> None:
    until = begin_at(carry(0), gripper((0.0, 0.6, 0.0), 0.0), CARRIES, None)
    assert isinstance(until, str)
    assert until.startswith("the tool is nearer to (0.55, -0.16, 0.25) m")


@pytest.mark.parametrize("angle", [np.pi, 2.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_pour_is_turned_about_the_bowl_that_stands(seed: int, angle: float) -> None:
    asked, place = pour(seed), np.array(BOWLS.place_m)
    tool = np.array([*beside(BOWLS.place_m[:2], angle), asked.positions[0, 2], *TOOL_DOWN, 0.0])
    made = begin_at(asked, tool, POURS, BOWLS)
    assert isinstance(made, Motion)
    by = Rotation.from_euler("z", angle - np.pi)
    np.testing.assert_allclose(made.positions - place, by.apply(asked.positions - place), atol=1e-9)
    lean, wanted = (
        Rotation.from_quat(motion.turns, scalar_first=True).apply([0.0, 0.0, -1.0]) for motion in (made, asked)
    )
    np.testing.assert_allclose(lean, by.apply(wanted), atol=1e-9)
    np.testing.assert_allclose(made.turns[0], tool[3:7], atol=1e-9)


def test_from_farther_away_a_pour_goes_to_where_it_begins_first() -> None:
    asked = pour(0)
    tool = np.array([*(asked.positions[0] + np.array([-0.02, 0.0, 0.03])), *TOOL_DOWN, 0.0])
    made = begin_at(asked, tool, POURS, BOWLS)
    assert isinstance(made, Motion)
    np.testing.assert_allclose(made.positions[0], tool[:3])
    np.testing.assert_allclose(made.positions[1:], asked.positions, atol=1e-9)
    assert len(made.speeds) == len(made.positions)
    assert made.speeds[1] <= 0.1


def test_a_carry_waits_for_a_grasp_and_a_pour_for_an_upright_bowl() -> None:
    held, lying = hanging(), CLOTH.particles(CLOTH.start(0), 256)
    grasp, parked = "the gripper holds the cloth", pointing_down(np.array([0.30, 0.0, 0.30]))
    assert waits_for(gripper((0, 0, 0), 0.0, max(CARRIES.openings_m)), held, CARRIES) == grasp
    assert waits_for(parked, lying, CARRIES) == grasp
    assert waits_for(gripper((0, 0, 0), 0.0, min(CARRIES.openings_m)), held, CARRIES) == ""
    leaning = Rotation.from_euler("x", 0.5) * Rotation.from_quat(TOOL_DOWN, scalar_first=True)
    water = WATER.particles(WATER.start(0), 300)
    leans = np.array([*AT, *leaning.as_quat(scalar_first=True), 0.0])
    assert waits_for(leans, water, POURS) == "the held bowl is upright"
    assert waits_for(np.array([*AT, *TOOL_DOWN, 0.0]), water, POURS) == ""


def test_a_pour_is_simulated_from_the_bowl_that_is_held_and_pours_what_it_was_drawn_for() -> None:
    count = WATER.preset("cpu").particle_count
    x, held = WATER.particles(WATER.start(1), count), WATER.stage.tool
    assert isinstance(held, HeldBowl)
    tool = np.array([*centre_of_bowl(x, held.radius_m, LIQUID.volume_m3), *TOOL_DOWN, 0.0])
    goal, model = WATER.goal(1, count), nominal_model("pour_water")
    plan = plan_of_suggestion("pour_water", x, goal, model, pour(2), SITE, tool=tool)
    assert not isinstance(plan, str)
    assert [branch.origin for branch in plan.branches] == ["asked"]
    np.testing.assert_allclose(plan.motion.positions[0], tool[:3])
    poured = BOWLS.share(plan.predicted)
    assert 0.05 < poured < 0.95
    far = np.linalg.norm(plan.predicted[:, :2] - np.array(BOWLS.place_m[:2]), axis=1)
    assert far.max() < 0.25
    with pytest.raises(PlanningError, match="nobody knows where the tool is"):
        plan_of_suggestion("pour_water", x, goal, model, pour(2), SITE)


def test_a_carried_cloth_comes_along() -> None:
    count = CLOTH.preset("cpu").particle_count
    x = hanging(count)
    goal, model = CLOTH.goal(0, count), nominal_model("cloth_hang")
    asked = carry(1)
    plan = plan_of_suggestion("cloth_hang", x, goal, model, asked, SITE, tool=gripper((0, 0, 0), 0.0, 0.004))
    assert not isinstance(plan, str)
    way = plan.motion.positions[-1] - plan.motion.positions[0]
    moved = (plan.predicted - x).mean(axis=0)
    assert np.linalg.norm(moved - way) < 0.5 * np.linalg.norm(way)
    until = plan_of_suggestion("cloth_hang", x, goal, model, asked, SITE, tool=gripper((0, 0, 0), 0.0, 0.08))
    assert until == "the gripper holds the cloth"
