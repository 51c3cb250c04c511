"""The arm that is not there behaves as the firmware of a real one is said to, also where that is unpleasant."""

import os
import signal
import socket
import struct
import subprocess
import sys
import time

import numpy as np
import psutil
import pytest

from app.rig.kinova.api import calls
from app.rig.kinova.api.codes import ActionEvent
from app.rig.kinova.api.error_messages import SESSION_NOT_IN_CONTROL
from app.rig.kinova.api.errors import Refused
from app.rig.kinova.api.messages import (
    ActionNotification,
    FingerMessage,
    GripperCommand,
    GripperMessage,
    InverseKinematicsData,
    JointAngle,
    JointAngles,
    Pose,
)
from app.rig.kinova.api.session import Empty, SessionInfo
from app.rig.kinova.api.setup import Point, ProtectionZone, ZoneShape
from app.rig.kinova.client.client import OwnLink
from app.rig.kinova.client.wire import MAGIC, FrameKind, KortexFrame, Splitter, decode_frame
from app.rig.kinova.emulator.adversity import FaultInjection
from app.rig.kinova.emulator.fingers import FULL_S, Fingers
from app.rig.kinova.emulator.process import FakeProcess
from app.rig.kinova.emulator.sessions import PASSWORD, USER, Sessions
from app.rig.kinova.emulator.timed import ACCELERATION_M_S2, TimedPath
from app.rig.kinova.emulator.zones import inside
from app.rig.kinova.gen3 import tool as forward
from app.rig.kinova.kortex import Kortex
from tests.conftest import ROOT
from tests.rig.kinova.conftest import address, tool, until, way

pytestmark = pytest.mark.serial

UP, STILL = np.array([0.0, 0.0, 0.05]), np.zeros(3)
DOWN = np.array([[1.0, 0, 0, 0.45], [0, -1, 0, 0], [0, 0, -1, 0.3], [0, 0, 0, 1]])


def test_a_session_is_silent_for_as_long_as_the_arm_itself_ran() -> None:
    sessions = Sessions()
    info = SessionInfo(username=USER, password=PASSWORD, connection_inactivity_timeout=150)
    session = sessions.create(info, None)
    assert sessions.silent(0.2) == []  # It was made since the last tick.
    assert sessions.silent(0.1) == []
    sessions.hear(session)
    assert [sessions.silent(0.08) for _ in range(2)] == [[], []]
    assert sessions.silent(0.08) == [session]
    assert sessions.silent(0.08) == []


def test_an_arm_that_another_session_takes_over_breaks_off_says_so_and_obeys_that(arm: FakeProcess) -> None:
    kortex = connected(arm, stops_after_s=30.0)
    kortex.go([way(0.45, 0.2, 0.3, speed=0.05)])
    until(lambda: arm.look()["moving"])
    before = kortex.feedback().base
    arm.take_over(0.1)
    told: list[object] = []
    until(lambda: told.extend(kortex.events()) or any(map(aborted, told)))
    (ended,) = filter(aborted, told)
    assert isinstance(ended, ActionNotification)
    assert ended.abort_details == SESSION_NOT_IN_CONTROL
    until(lambda: tool(arm)[2] > 0.31)
    after = kortex.feedback().base
    assert before is not None
    assert after is not None
    assert before.active_state_connection_identifier != after.active_state_connection_identifier
    with pytest.raises(Refused):
        kortex.twist(UP, STILL)
    kortex.stop()
    until(lambda: not arm.look()["moving"])
    kortex.close()


def aborted(told: object) -> bool:
    return isinstance(told, ActionNotification) and told.action_event == ActionEvent.ABORT


def connected(arm: FakeProcess, **changed: object) -> Kortex:
    kortex = Kortex(OwnLink(address(arm, **changed)))
    kortex.open()
    return kortex


def test_an_arm_whose_client_falls_silent_stops_what_that_moves(arm: FakeProcess) -> None:
    kortex = connected(arm, stops_after_s=0.4)
    kortex.twist(UP, STILL)
    until(lambda: arm.look()["moving"])
    begun = time.monotonic()
    until(lambda: not arm.look()["moving"])
    assert time.monotonic() - begun > 0.2
    assert not kortex.loss_reason
    kortex.stop()
    kortex.close()


def test_an_arm_whose_connection_is_cut_stops_only_after_that_time(arm: FakeProcess) -> None:
    kortex = connected(arm, stops_after_s=0.5)
    kortex.twist(UP, STILL)
    until(lambda: arm.look()["moving"])
    arm.cut()
    before = tool(arm)[2]
    time.sleep(0.1)
    assert tool(arm)[2] > before
    until(lambda: not arm.look()["moving"])
    kortex.close()


def test_a_session_that_says_nothing_for_long_is_closed(arm: FakeProcess) -> None:
    kortex = connected(arm, closes_after_s=0.3)
    until(lambda: arm.look()["sessions"] == [])
    with pytest.raises(Refused, match="session is not open"):
        kortex.state()
    kortex.close()


def test_a_motion_that_falls_short_is_reported_as_complete_all_the_same(arm: FakeProcess) -> None:
    kortex = connected(arm, stops_after_s=30.0)
    arm.set(FaultInjection(short_m=0.03))
    kortex.go([way(0.45, 0.0, 0.2)])
    ended = heard(kortex)
    assert ended.action_event == ActionEvent.END
    assert tool(arm)[2] == pytest.approx(0.23, abs=5e-3)
    kortex.close()


def test_joints_that_do_not_move_break_nothing_off_and_reach_nothing(arm: FakeProcess) -> None:
    kortex = connected(arm, stops_after_s=30.0)
    arm.set(FaultInjection(stuck=True))
    before = tool(arm)
    kortex.go([way(0.45, 0.0, 0.2)])
    time.sleep(0.3)
    assert tool(arm) == pytest.approx(before)
    assert arm.look()["moving"]
    kortex.close()


def test_a_way_into_a_zone_is_broken_off_with_the_reason(arm: FakeProcess) -> None:
    kortex = connected(arm, stops_after_s=30.0)
    kortex.forbid("floor", (0.45, 0.0, 0.1), (1.0, 1.0, 0.2))
    kortex.go([way(0.45, 0.0, 0.15)])
    ended = heard(kortex)
    assert ended.action_event == ActionEvent.ABORT
    assert [each.trajectory_info_type for each in ended.trajectory_info] == [11]
    assert tool(arm)[2] > 0.2
    kortex.close()


def test_a_push_at_the_tool_is_measured(arm: FakeProcess) -> None:
    kortex = connected(arm)
    arm.set(FaultInjection(force_n=12.0))
    base = kortex.feedback().base
    assert base is not None
    assert base.tool_external_wrench_force_z == pytest.approx(12.0)
    kortex.close()


def test_the_arm_s_own_kinematics_answer_forward_and_back(arm: FakeProcess) -> None:
    link = OwnLink(address(arm))
    link.open()
    joints = np.array(arm.look()["joints"])
    degrees = np.degrees(joints) % 360
    each = [JointAngle(joint_identifier=index, value=value) for index, value in enumerate(degrees.tolist())]
    angles = JointAngles(joint_angles=tuple(each))
    pose = link.call(calls.COMPUTE_FORWARD_KINEMATICS, angles)
    assert [pose.x, pose.y, pose.z] == pytest.approx(tool(arm), abs=1e-5)
    back = link.call(calls.COMPUTE_INVERSE_KINEMATICS, InverseKinematicsData(cartesian_pose=pose, guess=angles))
    found = np.radians([each.value for each in back.joint_angles])
    assert forward(found)[:3, 3] == pytest.approx(tool(arm), abs=1e-3)
    with pytest.raises(Refused, match="outside of what the arm reaches"):
        link.call(calls.COMPUTE_INVERSE_KINEMATICS, InverseKinematicsData(cartesian_pose=Pose(x=2.0), guess=angles))
    link.close()


def test_every_command_is_recorded_with_its_time_and_what_came_of_it(arm: FakeProcess) -> None:
    begun = time.monotonic()
    kortex = connected(arm)
    kortex.twist(np.array([0.3, 0.0, 0.4]), np.array([0.0, 0.0, 1.0]))
    kortex.stop()
    kortex.emergency_stop()
    with pytest.raises(Refused):
        kortex.go([way(0.45, 0.1, 0.2, speed=0.2)])
    told = arm.commands()
    assert [each["call"] for each in told] == ["SendTwistCommand", "Stop", "ApplyEmergencyStop", "ExecuteAction"]
    assert told[0]["linear_m_s"] == pytest.approx(0.5)
    assert told[0]["angular_deg_s"] == pytest.approx(np.degrees(1.0))
    assert told[3]["positions"] == [pytest.approx([0.45, 0.1, 0.2])]
    assert [each["refused"] for each in told] == [0, 0, 0, 25]
    assert all(begun <= each["time_s"] <= time.monotonic() for each in told)
    kortex.close()


def test_garbage_on_the_stream_ends_that_connection_and_no_other(arm: FakeProcess) -> None:
    kortex = connected(arm)
    with socket.create_connection((arm.host, arm.ports[0])) as garbage:
        garbage.sendall(b"GET / HTTP/1.1\r\n\r\n")
        garbage.settimeout(5)
        assert garbage.recv(1) == b""
    with socket.socket(socket.AF_INET, socket.SOCK_DGRAM) as garbage:
        garbage.sendto(os.urandom(64), (arm.host, arm.ports[1]))
    assert kortex.ready()
    kortex.feedback()
    kortex.close()


def test_unknown_calls_sessions_and_messages_are_answered_with_errors(arm: FakeProcess) -> None:
    with socket.create_connection((arm.host, arm.ports[0])) as raw:
        raw.settimeout(5)

        def asked(frame: KortexFrame) -> KortexFrame:
            raw.sendall(frame.encode_for_stream())
            splitter = Splitter()
            while not (found := splitter.feed(raw.recv(4096))):
                continue
            return decode_frame(found[0])

        nobody = asked(KortexFrame(kind=FrameKind.REQUEST, service=2, function=175, session=999))
        assert (nobody.error, nobody.sub_error) == (1, 12)
        login = bytes.fromhex("0a0561646d696e1a0561646d696e")
        session = asked(KortexFrame(kind=FrameKind.REQUEST, service=1, function=1, message=5, payload=login))
        assert (session.error, session.message) == (0, 5)
        known = {"kind": FrameKind.REQUEST, "session": session.session}
        assert asked(KortexFrame(**known, service=2, function=999)).sub_error == 5
        assert asked(KortexFrame(**known, service=999, function=1)).sub_error == 4
        assert asked(KortexFrame(**known, service=2, function=121, payload=b"\x0b")).sub_error == 13
        assert asked(KortexFrame(**known, service=2, function=175)).error == 0
        raw.sendall(KortexFrame(kind=FrameKind.PING).encode_for_stream())
        assert raw.recv(8) == MAGIC
        assert struct.unpack(">I", raw.recv(4))[0] > 0


def test_a_timed_way_keeps_speed_and_acceleration_and_ends_where_it_should() -> None:
    ways = (way(0.45, 0.2, 0.3, speed=0.2, radius=0.05), way(0.6, 0.2, 0.3, speed=0.1), way(0.6, 0.2, 0.2, turn=90.0))
    path = TimedPath(DOWN, ways)
    times = np.arange(0.0, path.duration_s, 0.01)
    points = np.array([path.at(time)[:3, 3] for time in times])
    speeds = np.linalg.norm(np.diff(points, axis=0), axis=1) / 0.01
    assert speeds.max() < 0.301
    assert np.abs(np.diff(speeds)).max() / 0.01 < 1.5 * ACCELERATION_M_S2
    assert path.at(path.duration_s)[:3, 3] == pytest.approx([0.6, 0.2, 0.2])
    # It cuts the corner that blends, by no more than the radius, and rests at the one that does not.
    to_corner = np.linalg.norm(points - [0.45, 0.2, 0.3], axis=1).min()
    assert 0.005 < to_corner < 0.05
    assert np.linalg.norm(points - [0.6, 0.2, 0.3], axis=1).min() < 1e-3


def test_fingers_take_their_time_and_hold_what_they_meet() -> None:
    fingers = Fingers()
    fingers.command(GripperCommand(mode=3, gripper=GripperMessage(finger=(FingerMessage(value=1.0),))))
    fingers.advance(FULL_S / 2, 1.0)
    assert fingers.position == pytest.approx(0.5)
    assert fingers.moving
    fingers.advance(FULL_S, 0.8)
    assert (fingers.position, fingers.moving, fingers.holds) == (pytest.approx(0.8), False, True)
    fingers.command(GripperCommand(mode=2, gripper=GripperMessage(finger=(FingerMessage(value=0.5),))))
    fingers.advance(FULL_S, 0.8)
    assert (fingers.position, fingers.holds) == (pytest.approx(0.3), False)


@pytest.mark.parametrize(
    ("shape", "sizes", "within", "without"),
    [
        (1, (0.1, 0.2), (0.09, 0.0, 0.09), (0.0, 0.0, 0.11)),
        (2, (0.1,), (0.05, 0.05, 0.05), (0.07, 0.07, 0.07)),
        (3, (0.1, 0.2, 0.3), (0.04, 0.09, 0.14), (0.06, 0.0, 0.0)),
    ],
)
def test_zones_are_where_their_shapes_say(shape: int, sizes: tuple, within: tuple, without: tuple) -> None:
    zone = ProtectionZone(is_enabled=True, shape=ZoneShape(shape_type=shape, origin=Point(x=1.0), dimensions=sizes))
    origin = np.array([1.0, 0.0, 0.0])
    assert inside(zone, origin + within)
    assert not inside(zone, origin + without)


_START_AND_WAIT = """
from app.rig.kinova.emulator.process import FakeProcess
import time
if __name__ == "__main__":
    with FakeProcess() as process:
        print(process.pid, flush=True)
        time.sleep(60)
"""


def test_the_process_ends_with_the_one_that_started_it(tmp_path) -> None:
    (tmp_path / "start.py").write_text(_START_AND_WAIT)
    environment = {**os.environ, "PYTHONPATH": str(ROOT)}
    with subprocess.Popen([sys.executable, tmp_path / "start.py"], stdout=subprocess.PIPE, env=environment) as starter:
        assert starter.stdout is not None
        pid = int(starter.stdout.readline())
        starter.send_signal(signal.SIGKILL)
    until(lambda: not psutil.pid_exists(pid) or psutil.Process(pid).status() == psutil.STATUS_ZOMBIE)


def test_the_process_ends_where_it_is_left() -> None:
    with FakeProcess() as process:
        pid = process.pid
        assert psutil.pid_exists(pid)
    assert not psutil.pid_exists(pid)


def heard(kortex: Kortex) -> ActionNotification:
    """The end of the action that runs."""
    ends: list[ActionNotification] = []

    def ended() -> bool:
        told = [each for each in kortex.events() if isinstance(each, ActionNotification)]
        ends.extend(each for each in told if each.action_event in (ActionEvent.END, ActionEvent.ABORT))
        return bool(ends)

    until(ended)
    return ends[0]


def test_calls_by_their_numbers_are_all_answered(arm: FakeProcess) -> None:
    link = OwnLink(address(arm))
    link.open()
    for call in vars(calls).values():
        if isinstance(call, calls.Call) and call.asked is Empty and call is not calls.CLOSE_SESSION:
            assert isinstance(link.call(call, Empty()), call.answered)
    link.close()


def test_a_world_can_follow_the_arm_in_shared_memory(arm: FakeProcess) -> None:
    kortex = connected(arm, stops_after_s=30.0)
    before = arm.states.count
    kortex.go([way(0.45, 0.0, 0.25)])
    kortex.grip(1.0)
    heard(kortex)
    until(lambda: arm.states.newest()["closed"] == pytest.approx(1.0))
    states = arm.states.since(before)
    assert (np.diff(states["time_s"]) > 0).all()
    assert states[-1]["tool"][:3, 3] == pytest.approx([0.45, 0.0, 0.25], abs=2e-3)
    assert forward(states[-1]["joints"]) == pytest.approx(states[-1]["tool"])
    assert np.abs(states["velocity"]).max() > 0.1
    kortex.close()
