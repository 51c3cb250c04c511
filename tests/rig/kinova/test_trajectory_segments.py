"""A path as waypoints, at the speeds that were asked for and rounded no more than is safe; and what was measured."""

import dataclasses

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.config import KeepOut, Limits
from app.core.motion import pointing_down
from app.rig.kinova import gen3
from app.rig.kinova.api.feedback import ActuatorFeedback, BaseFeedback, Feedback
from app.rig.kinova.control import extrapolate_tool
from app.rig.kinova.feedback_conversion import feedback_of
from app.rig.kinova.trajectory_segments import BLEND_M, stretches
from app.rig.kinova.workspace_limiter import LATE_S, hold_back

OPENING_M = 0.085


def poses(*positions: tuple[float, float, float], openings: tuple[float, ...] = ()) -> np.ndarray:
    rows = np.array([pointing_down(np.array(each)) for each in positions])
    if openings:
        rows[:, 7] = openings
    return rows


def made(points: np.ndarray, speed: float = 0.1):
    return stretches(points, np.full(len(points) - 1, speed), OPENING_M, 1.0)


def test_every_point_but_the_first_is_a_waypoint_at_its_speed() -> None:
    points = poses((0.4, 0, 0.3), (0.4, 0, 0.1), (0.5, 0, 0.1), (0.5, 0.1, 0.1))
    (stretch,) = stretches(points, np.array([0.3, 0.1, 0.05]), OPENING_M, 1.0)
    assert [way.maximum_linear_velocity for way in stretch.ways] == pytest.approx([0.3, 0.1, 0.05])
    said = [way.pose for way in stretch.ways]
    assert [[pose.x, pose.y, pose.z] for pose in said if pose] == [pytest.approx(each) for each in points[1:, :3]]
    assert {abs(pose.theta_x) for pose in said if pose} == {180.0}
    assert stretch.closed is None
    assert stretch.duration_s == pytest.approx(0.2 / 0.3 + 1.0 + 2.0)


def test_gentle_corners_are_rounded_a_little_and_sharp_ones_and_the_last_are_not() -> None:
    (stretch,) = made(poses((0.4, 0, 0.1), (0.5, 0, 0.1), (0.6, 0.02, 0.1), (0.6, 0.02, 0.2), (0.6, 0.02, 0.3)))
    assert [way.blending_radius for way in stretch.ways] == pytest.approx([BLEND_M, 0.0, BLEND_M, 0.0])


def test_radii_fit_between_waypoints_that_are_close() -> None:
    angles = np.linspace(0, 1, 21)
    points = poses(*[(0.4 + 0.02 * np.cos(a), 0.02 * np.sin(a), 0.1) for a in angles])
    (stretch,) = made(points)
    lengths = np.linalg.norm(np.diff(points[:, :3], axis=0), axis=1)
    radii = np.array([0.0, *(way.blending_radius for way in stretch.ways)])
    assert (radii[:-1] + radii[1:] <= lengths).all()
    assert radii[1:-1].min() > 0


def test_a_turn_in_place_takes_as_long_as_its_speed_at_the_lever_says() -> None:
    points = poses((0.4, 0, 0.2), (0.4, 0, 0.2))
    turned = Rotation.from_euler("z", 90, degrees=True) * Rotation.from_quat(points[1, 3:7], scalar_first=True)
    points[1, 3:7] = turned.as_quat(scalar_first=True)
    (stretch,) = made(points, speed=0.05)
    assert stretch.duration_s == pytest.approx(0.1 * np.pi / 2 / 0.05)
    assert stretch.ways[0].maximum_angular_velocity == pytest.approx(np.degrees(0.5))


def test_fingers_move_between_stretches_and_are_waited_for_where_the_tool_stays() -> None:
    above, at = (0.4, 0, 0.3), (0.4, 0, 0.1)
    points = poses(above, at, at, above, openings=(0.08, 0.08, 0.0, 0.0))
    down, grip, up = made(points)
    assert (down.closed, len(down.ways)) == (None, 1)
    assert (grip.closed, grip.ways) == (1.0, ())
    assert (up.closed, len(up.ways)) == (None, 1)


def test_fingers_that_move_on_the_way_begin_with_it() -> None:
    (stretch,) = made(poses((0.4, 0, 0.3), (0.4, 0, 0.2), (0.4, 0, 0.1), openings=(0.0, 0.0425, 0.0425)))
    assert stretch.closed == pytest.approx(0.5)
    assert len(stretch.ways) == 2


def measured() -> Feedback:
    base = BaseFeedback(active_state=7, tool_pose_x=0.4, tool_pose_theta_x=180.0, tool_external_wrench_force_z=-3.0)
    return Feedback(base=base, actuators=tuple(ActuatorFeedback(position=350.0 if n == 2 else 10.0) for n in range(7)))


def test_what_was_measured_is_said_in_radians_and_quaternions() -> None:
    found = feedback_of(measured(), 5.0, OPENING_M)
    assert found is not None
    assert found.tool == pytest.approx(np.array([0.4, 0, 0, 0, 1, 0, 0, 0]))
    assert found.joints[[0, 2]] == pytest.approx(np.radians([10.0, -10.0]))
    assert found.force == pytest.approx([0, 0, -3.0])
    assert (found.ready, found.still, found.faults) == (True, True, ())
    upside = dataclasses.replace(measured(), base=BaseFeedback(active_state=7, tool_pose_theta_x=-180.0))
    again = feedback_of(upside, 5.0, OPENING_M)
    assert again is not None
    assert again.tool[3:7] == pytest.approx([0, 1, 0, 0])


def test_a_tool_that_moves_is_as_much_further_now_as_it_was_seen_earlier() -> None:
    moving = dataclasses.replace(measured(), base=BaseFeedback(tool_pose_x=0.4, tool_twist_linear_y=0.2))
    found = feedback_of(moving, 5.0, OPENING_M)
    assert found is not None
    assert extrapolate_tool(found, 5.01)[:3] == pytest.approx([0.4, 0.002, 0.0])
    assert extrapolate_tool(found, 9.0)[:3] == pytest.approx([0.4, 0.01, 0.0])
    still = feedback_of(measured(), 5.0, OPENING_M)
    assert still is not None
    assert extrapolate_tool(still, 5.01) == pytest.approx(still.tool)


def test_measured_numbers_that_are_none_are_not_believed() -> None:
    broken = dataclasses.replace(measured(), base=BaseFeedback(tool_pose_y=float("nan")))
    assert feedback_of(broken, 5.0, OPENING_M) is None
    assert feedback_of(dataclasses.replace(measured(), actuators=()), 5.0, OPENING_M) is None


def test_a_fault_of_a_joint_is_a_sentence() -> None:
    hot = ActuatorFeedback(fault_bank_a=1 << 17)
    found = feedback_of(
        dataclasses.replace(measured(), actuators=(hot,) * 1 + measured().actuators[1:]), 5.0, OPENING_M
    )
    assert found is not None
    assert found.faults == ("Joint 1 has a motor that is too hot; let it cool down.",)


def test_no_waypoint_is_faster_than_the_arm_may_be() -> None:
    (stretch,) = made(poses((0.4, 0, 0.3), (0.4, 0, 0.1)), speed=3.0)
    assert stretch.ways[0].maximum_linear_velocity == gen3.LINEAR_M_S


@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_tool_that_obeys_late_stops_before_every_wall(axis: int, side: float) -> None:
    limits, position, velocity = Limits(), np.array([0.5, 0.0, 0.2]), np.zeros(3)
    wanted = side * 0.3 * np.eye(3)[axis]
    told = [np.zeros(3)] * round(LATE_S / 0.01)
    for _ in range(500):
        told.append(hold_back(wanted, position, limits))
        velocity = told.pop(0)
        position = position + 0.01 * velocity
    room = np.minimum(position - limits.workspace.low, np.array(limits.workspace.high) - position)
    assert -1e-6 < room[axis] < 0.02


def test_a_volume_that_is_kept_free_holds_a_tool_back_and_lets_it_pass_beside() -> None:
    stand = KeepOut(name="stand", low=(0.6, -0.1, 0.0), high=(0.7, 0.1, 0.3))
    limits = Limits(keep_out=(stand,))
    towards = np.array([0.3, 0.0, 0.0])
    assert hold_back(towards, np.array([0.599, 0.0, 0.1]), limits)[0] < 0.02
    assert hold_back(towards, np.array([0.599, 0.2, 0.1]), limits) == pytest.approx(towards)
    assert hold_back(-towards, np.array([0.599, 0.0, 0.1]), limits) == pytest.approx(-towards)
    assert hold_back(-towards, np.array([0.61, 0.0, 0.1]), limits) == pytest.approx(-towards)
