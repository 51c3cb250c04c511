"""The kinematics against the arm's published Denavit-Hartenberg table, and against themselves."""

import numpy as np
import pytest
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.config import Workspace
from app.core.motion import pointing_down
from app.rig.kinova import gen3

# Kinova Gen3 Ultra lightweight robot user guide, classical DH parameters of the arm with seven joints: twist [rad],
# offset [m] and angle [rad] where the joint is at zero; the base's frame is turned by pi about x. Lengths to 0.1 mm.
TABLE = [
    (np.pi / 2, -(0.1564 + 0.1284), 0.0),
    (np.pi / 2, -(0.0054 + 0.0064), np.pi),
    (np.pi / 2, -(0.2104 + 0.2104), np.pi),
    (np.pi / 2, -(0.0064 + 0.0064), np.pi),
    (np.pi / 2, -(0.2084 + 0.1059), np.pi),
    (np.pi / 2, 0.0, np.pi),
    (np.pi, -(0.1059 + 0.0615), np.pi),
]
ROUNDING_M = 6e-4
"""Error of a place [m] from eleven lengths that are rounded to 0.1 mm."""
RNG = np.random.default_rng(0)
DOWN = np.diag([1.0, -1.0, -1.0, 1.0])


def by_table(joints: Float64[np.ndarray, "7"]) -> Float64[np.ndarray, "4 4"]:
    frame = DOWN
    for (twist, offset, zero), joint in zip(TABLE, joints, strict=True):
        c, s, ct, st = np.cos(joint + zero), np.sin(joint + zero), np.cos(twist), np.sin(twist)
        frame = frame @ np.array([[c, -s * ct, s * st, 0], [s, c * ct, -c * st, 0], [0, st, ct, offset], [0, 0, 0, 1]])
    return frame @ np.array([[1, 0, 0, 0], [0, 1, 0, 0], [0, 0, 1, gen3.GRIPPER_M], [0, 0, 0, 1]])


def anywhere() -> Float64[np.ndarray, "7"]:
    return RNG.uniform(-0.95, 0.95, 7) * np.where(np.isfinite(gen3.RANGE), gen3.RANGE, np.pi)


def with_its_elbow_aside(arc_rad: float) -> Float64[np.ndarray, "7"]:
    """Joints moved by so much without moving the tool, as they drift in the course of many motions."""
    joints, step_rad = gen3.HOME, 0.05
    target = DOWN.copy()
    target[:3, 3] = 0.45, 0.0, 0.12
    for _ in range(round(arc_rad / step_rad)):
        aside = np.linalg.svd(gen3.jacobian(gen3.frames(joints)))[2][-1]
        moved = joints + step_rad * np.sign(aside[2]) * aside
        joints = gen3.nearer(np.clip(moved, -gen3.RANGE, gen3.RANGE), target)
    return joints


def test_the_chain_of_links_is_that_of_the_published_table() -> None:
    for _ in range(50):
        joints = anywhere()
        assert np.abs(gen3.tool(joints) - by_table(joints)).max() < ROUNDING_M


def test_stretched_upwards_the_arm_is_as_tall_as_its_lengths() -> None:
    tall = gen3.tool(np.zeros(7))
    assert tall[2, 3] - gen3.GRIPPER_M == pytest.approx(1.1874, abs=1e-4)
    assert tall[:3, :3] == pytest.approx(np.eye(3), abs=1e-9)


def test_the_jacobian_is_the_slope_of_the_tool() -> None:
    step = 1e-6
    for _ in range(5):
        joints = anywhere()
        links = gen3.frames(joints)
        for index in range(7):
            moved = gen3.tool(joints + step * np.eye(7)[index])
            slope = gen3.away(links, moved) / step
            assert gen3.jacobian(links)[:, index] == pytest.approx(slope, abs=1e-5)


def test_the_inverse_finds_what_the_forward_says_from_a_guess_nearby() -> None:
    for _ in range(20):
        joints = np.clip(anywhere(), -2.0, 2.0)
        target = gen3.tool(joints)
        found = gen3.solve_joints(target, joints + RNG.uniform(-0.2, 0.2, 7))
        assert found is not None
        assert np.abs(gen3.tool(found) - target).max() < 1e-3


@pytest.mark.parametrize(("x", "z", "within"), [(0.45, 0.05, True), (0.65, 0.15, True), (0.75, 0.05, False)])
def test_how_far_a_tool_that_points_down_gets_is_what_the_links_allow(x: float, z: float, within: bool) -> None:
    target = DOWN.copy()
    target[:3, 3] = x, 0.0, z
    # From the shoulder at 0.285 m to the wrist, 0.287 m above the tip: at most the 0.735 m of both upper links.
    away = np.hypot(x, z + 0.287 - 0.285)
    assert (away < 0.735) == within
    assert (gen3.solve_joints(target, gen3.HOME) is not None) == within


def test_what_is_said_of_the_reach_is_what_the_inverse_finds() -> None:
    reach, met = gen3.reach(gen3.GRIPPER_M), [0, 0]
    for _ in range(40):
        place = RNG.uniform((0.25, -0.5, 0.0), (0.85, 0.5, 0.4))
        beyond_m = float(reach.beyond_m(pointing_down(place)))
        if abs(beyond_m) < 0.01:
            continue
        target = DOWN.copy()
        target[:3, 3] = place
        found = gen3.solve_joints(target, gen3.HOME) is not None
        assert found == (beyond_m < 0), f"{place} is {beyond_m:.3f} m beyond"
        met[found] += 1
    assert min(met) > 5


@pytest.mark.parametrize("arc_rad", [0.0, 1.0, 2.0])
def test_wherever_its_elbow_is_the_arm_gets_to_all_of_the_workspace_that_is_within_reach(arc_rad: float) -> None:
    """No joint is at the end of its range there, so that the distance alone decides what the arm refuses."""
    reach, workspace, joints = gen3.reach(gen3.GRIPPER_M), Workspace(), with_its_elbow_aside(arc_rad)
    places = RNG.uniform(workspace.low, workspace.high, (80, 3))
    within = [place for place in places if reach.beyond_m(pointing_down(place)) < 0]
    assert len(within) > 20
    for place in within:
        target = DOWN.copy()
        target[:3, 3] = place
        assert gen3.solve_joints(target, joints) is not None, f"{place}"


def test_no_joints_bring_the_wrist_further_than_the_reach() -> None:
    reach = gen3.reach(0.2)
    for _ in range(200):
        tool = gen3.tool(anywhere() * RNG.uniform(0.0, 1.0))
        tip = tool[:3, 3] + (0.2 - gen3.GRIPPER_M) * tool[:3, 2]
        turn = Rotation.from_matrix(tool[:3, :3]).as_quat(scalar_first=True)
        assert reach.beyond_m(np.array([*tip, *turn])) < 0.0055


def test_joints_that_the_inverse_finds_are_within_their_ranges() -> None:
    for _ in range(20):
        joints = gen3.HOME
        target = gen3.tool(anywhere())
        for _ in range(30):
            joints = gen3.nearer(joints, target)
            assert (np.abs(joints) <= gen3.RANGE).all()


def test_a_pose_in_the_arm_s_words_is_the_same_pose() -> None:
    for _ in range(20):
        frame = gen3.tool(anywhere())
        assert gen3.transform(gen3.pose(frame)) == pytest.approx(frame, abs=1e-9)


def test_a_tool_that_points_down_is_turned_by_half_a_turn_about_x() -> None:
    said = gen3.pose(DOWN)
    assert abs(said.theta_x) == pytest.approx(180.0)
    assert (said.theta_y, said.theta_z) == pytest.approx((0.0, 0.0))
