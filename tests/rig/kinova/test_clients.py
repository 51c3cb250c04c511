"""Both clients against an arm that answers as the firmware does: calls, refusals, losses and returns."""

import dataclasses
import importlib.util
import socket
import threading
import time

import numpy as np
import pytest

from app.core.errors import MotionRefused, PreflightError
from app.rig.kinova import gen3
from app.rig.kinova.api import calls
from app.rig.kinova.api.codes import ActionEvent, ArmStateCode, ServoingMode
from app.rig.kinova.api.error_messages import ROBOT_IN_EMERGENCY_STOP, SESSION_NOT_IN_CONTROL
from app.rig.kinova.api.errors import LinkLost, NoAnswer, Refused
from app.rig.kinova.api.messages import ActionNotification
from app.rig.kinova.api.session import ArmStateNotification, Empty
from app.rig.kinova.client.client import OwnLink
from app.rig.kinova.client.link import Link
from app.rig.kinova.client.official import OfficialLink
from app.rig.kinova.emulator.adversity import FaultInjection
from app.rig.kinova.emulator.process import FakeProcess
from app.rig.kinova.kortex import Kortex
from tests.rig.kinova.conftest import PATIENT_S, address, keep_alive, tool, until, way

pytestmark = pytest.mark.serial

STILL, STRAIGHT_UP = np.zeros(3), np.array([0.0, 0.0, 0.05])


def events(kortex: Kortex) -> list[ActionEvent]:
    """Events of the running action, until it has ended."""
    heard: list[ActionNotification] = []

    def ended() -> bool:
        heard.extend(each for each in kortex.events() if isinstance(each, ActionNotification))
        return any(each.action_event in (ActionEvent.END, ActionEvent.ABORT) for each in heard)

    until(ended)
    return [ActionEvent(each.action_event) for each in heard]


def test_an_arm_that_is_ready_says_what_it_is(kortex: Kortex) -> None:
    assert kortex.ready()
    assert kortex.joint_count() == 7
    assert kortex.firmware()
    limits = kortex.hard_limits()
    assert (limits.twist_linear, limits.twist_angular) == (0.5, 100.0)
    assert len(limits.joint_speed_limits) == 7


def test_feedback_says_where_the_arm_is(kortex: Kortex, arm: FakeProcess) -> None:
    said = kortex.feedback()
    assert said.base is not None
    assert said.interconnect is not None
    measured = [said.base.tool_pose_x, said.base.tool_pose_y, said.base.tool_pose_z]
    assert measured == pytest.approx(tool(arm), abs=1e-5)
    assert len(said.actuators) == 7
    assert all(0 <= joint.position < 360 for joint in said.actuators)


def test_a_way_is_checked_gone_and_reported(kortex: Kortex, arm: FakeProcess) -> None:
    ways = [way(0.45, 0.0, 0.20, speed=0.5), way(0.45, 0.1, 0.15, speed=0.5)]
    kortex.check(ways)
    kortex.go(ways)
    assert events(kortex) == [
        ActionEvent.PREPROCESS_START,
        ActionEvent.PREPROCESS_END,
        ActionEvent.START,
        ActionEvent.END,
    ]
    assert tool(arm) == pytest.approx([0.45, 0.1, 0.15], abs=2e-3)


@pytest.mark.parametrize(
    ("ways", "says"),
    [
        ([way(0.85, 0.3, 0.1)], "outside of what the arm reaches"),
        ([way(0.45, 0.0, 0.2, speed=0.8)], "speed outside the limits"),
        ([way(0.45, 0.0, 0.2), way(0.45, 0.1, 0.2, radius=0.01)], "last must stop"),
        ([way(0.45, 0.0, 0.2, radius=0.4), way(0.45, 0.05, 0.2)], "blending radius"),
        ([dataclasses.replace(way(0.45, 0.0, 0.2), reference_frame=2)], "in a frame"),
        ([], "too long"),
    ],
)
def test_a_way_that_the_arm_would_not_go_is_refused_with_the_reason(kortex: Kortex, ways: list, says: str) -> None:
    with pytest.raises(MotionRefused, match=says):
        kortex.check(ways)


def test_a_twist_goes_on_until_it_is_stopped(kortex: Kortex, arm: FakeProcess) -> None:
    before = tool(arm)
    kortex.twist(STRAIGHT_UP, STILL)
    until(lambda: tool(arm)[2] > before[2] + 0.02)
    assert arm.look()["moving"]
    kortex.stop()
    until(lambda: not arm.look()["moving"])
    rest = tool(arm)
    time.sleep(0.1)
    assert tool(arm) == pytest.approx(rest, abs=1e-6)


def test_the_arm_s_own_limits_hold_for_twists(kortex: Kortex, arm: FakeProcess) -> None:
    kortex.limit(0.02, 0.5)
    kortex.twist(np.array([0.0, 0.0, 0.4]), STILL)
    fastest = 0.0
    for _ in range(30):
        base = kortex.feedback().base
        assert base is not None
        fastest = max(fastest, base.tool_twist_linear_z)
        time.sleep(0.01)
    kortex.stop()
    assert 0.01 < fastest < 0.03


def test_the_fingers_close_and_open_and_stop_at_what_is_between_them(kortex: Kortex, arm: FakeProcess) -> None:
    kortex.grip(1.0)
    until(lambda: kortex.gripper_closure() > 0.99)
    kortex.grip_on(1.0)
    until(lambda: kortex.gripper_closure() < 0.01)
    arm.set(FaultInjection(object_at=0.4))
    kortex.grip(1.0)
    until(lambda: kortex.gripper_closure() > 0.35)
    time.sleep(0.2)
    assert kortex.gripper_closure() == pytest.approx(0.4, abs=0.01)


def test_an_emergency_stop_is_a_fault_until_it_is_cleared(kortex: Kortex, arm: FakeProcess) -> None:
    kortex.twist(STRAIGHT_UP, STILL)
    until(lambda: arm.look()["moving"])
    kortex.emergency_stop()
    until(lambda: kortex.state() == ArmStateCode.IN_FAULT)
    assert not arm.look()["moving"]
    with pytest.raises(Refused, match="emergency stop") as refused:
        kortex.twist(STRAIGHT_UP, STILL)
    assert refused.value.sub_code == ROBOT_IN_EMERGENCY_STOP
    kortex.clear_faults()
    assert kortex.ready()
    states: list[int] = []

    def told() -> bool:
        states.extend(each.active_state for each in kortex.events() if isinstance(each, ArmStateNotification))
        return ArmStateCode.IN_FAULT in states

    until(told)


def test_a_fault_breaks_off_what_runs_and_stays_while_its_cause_does(kortex: Kortex, arm: FakeProcess) -> None:
    kortex.go([way(0.45, 0.0, 0.1, speed=0.05)])
    until(lambda: arm.look()["moving"])
    arm.fail(joint=3, bits=1 << 17, lasting=True)
    assert events(kortex)[-1] == ActionEvent.ABORT
    kortex.clear_faults()
    said = kortex.feedback()
    assert said.actuators[2].fault_bank_a == 1 << 17
    arm.fail()
    kortex.clear_faults()
    assert kortex.ready()


def test_another_session_in_control_is_said_in_words(kortex: Kortex, arm: FakeProcess) -> None:
    arm.set(FaultInjection(foreign=True))
    with pytest.raises(Refused, match="another session has control") as refused:
        kortex.go([way(0.45, 0.0, 0.2)])
    assert refused.value.sub_code == SESSION_NOT_IN_CONTROL


def test_another_servoing_mode_refuses_motions_until_it_is_set_back(kortex: Kortex) -> None:
    kortex.servo(ServoingMode.LOW_LEVEL)
    with pytest.raises(Refused, match="servoing mode"):
        kortex.twist(STRAIGHT_UP, STILL)
    kortex.servo()
    kortex.twist(STILL, STILL)


def test_a_motion_that_is_stopped_is_reported_as_broken_off(kortex: Kortex, arm: FakeProcess) -> None:
    kortex.go([way(0.45, 0.0, 0.1, speed=0.05)])
    until(lambda: arm.look()["moving"])
    time.sleep(0.2)
    kortex.stop()
    assert events(kortex)[-1] == ActionEvent.ABORT


def test_a_motion_that_is_paused_stands_and_goes_on(kortex: Kortex, arm: FakeProcess) -> None:
    kortex.go([way(0.45, 0.0, 0.30, speed=0.1)])
    until(lambda: arm.look()["moving"])
    time.sleep(0.2)
    kortex.pause()
    time.sleep(0.3)
    stands = tool(arm)
    time.sleep(0.1)
    assert tool(arm) == pytest.approx(stands, abs=1e-6)
    kortex.resume()
    assert events(kortex)[-1] == ActionEvent.END
    assert tool(arm) == pytest.approx([0.45, 0.0, 0.30], abs=2e-3)


def test_home_is_found_by_its_name(kortex: Kortex, arm: FakeProcess) -> None:
    kortex.go_home()
    assert events(kortex)[-1] == ActionEvent.END
    assert tool(arm) == pytest.approx(gen3.tool(gen3.HOME)[:3, 3], abs=1e-3)


def test_a_protection_zone_stops_twists_and_ways_and_can_be_removed(kortex: Kortex, arm: FakeProcess) -> None:
    x, y, z = tool(arm)
    number = kortex.forbid("ceiling", (x, y, z + 0.15), (0.5, 0.5, 0.2))
    assert kortex.forbidden() == {"ceiling": number}
    kortex.twist(np.array([0.0, 0.0, 0.2]), STILL)
    until(lambda: not arm.look()["moving"])
    assert tool(arm)[2] < z + 0.0501
    kortex.allow(number)
    assert kortex.forbidden() == {}
    kortex.twist(np.array([0.0, 0.0, 0.2]), STILL)
    until(lambda: tool(arm)[2] > z + 0.06)
    kortex.stop()


def test_a_stop_waits_for_no_other_call(kortex: Kortex, arm: FakeProcess) -> None:
    kortex.twist(STRAIGHT_UP, STILL)
    hard = [way(0.85, 0.3, 0.1 + 0.001 * index, radius=0.0) for index in range(1)]
    done: list[float] = []

    def check() -> None:
        for _ in range(5):
            with pytest.raises(MotionRefused):
                kortex.check(hard)
        done.append(time.monotonic())

    other = threading.Thread(target=check)
    other.start()
    time.sleep(0.02)
    kortex.stop()
    stopped = time.monotonic()
    other.join()
    assert stopped < done[0]
    until(lambda: not arm.look()["moving"])


def test_a_wrong_password_is_said_and_nothing_is_left_open(arm: FakeProcess) -> None:
    link = OwnLink(address(arm, password="guess"))
    with pytest.raises(Refused, match="password is wrong"):
        link.open()
    assert link.loss_reason
    assert arm.look()["sessions"] == []


def test_nobody_there_is_said_with_what_to_check(arm: FakeProcess) -> None:
    with socket.socket() as taken:
        taken.bind((arm.host, 0))
        nobody = taken.getsockname()[1]
        with pytest.raises(LinkLost, match="check its power"):
            OwnLink(address(arm, tcp_port=nobody)).open()


def test_calls_without_a_connection_say_so(arm: FakeProcess) -> None:
    link = OwnLink(address(arm))
    with pytest.raises(LinkLost, match="no connection"):
        link.call(calls.STOP, Empty())
    link.close()


def test_a_connection_that_is_cut_is_noticed_and_made_again_without_a_restart(link: Link, arm: FakeProcess) -> None:
    kortex = Kortex(link)
    for _ in range(2):
        kortex.open()
        assert kortex.ready()
        arm.cut()
        if isinstance(link, OwnLink):
            until(lambda: kortex.loss_reason)
        with pytest.raises(LinkLost):
            kortex.state()
        assert kortex.loss_reason
    kortex.open()
    assert kortex.ready()


def test_an_arm_that_accepts_and_never_answers_is_given_up_in_time(link: Link, arm: FakeProcess) -> None:
    kortex = Kortex(link)
    kortex.open()
    arm.set(FaultInjection(deaf=True))
    with pytest.raises(NoAnswer, match="did not answer Stop"):
        kortex.stop(timeout_s=0.2)
    assert "did not answer" in kortex.loss_reason
    with pytest.raises(LinkLost):
        kortex.clear_faults()
    arm.set(FaultInjection())
    kortex.open()
    kortex.stop()


def test_a_life_that_is_shown_to_nobody_ends_the_connection(arm: FakeProcess) -> None:
    kortex = Kortex(OwnLink(address(arm, stops_after_s=PATIENT_S)))
    kortex.open()
    arm.set(FaultInjection(deaf=True))
    begun = time.monotonic()
    keep_alive(kortex, threading.Event())
    assert "has not answered KeepAlive" in kortex.loss_reason
    assert time.monotonic() - begun > 0.5
    arm.set(FaultInjection())
    kortex.close()


def test_a_session_that_the_arm_has_closed_is_noticed_by_whoever_keeps_it_alive(arm: FakeProcess) -> None:
    kortex = Kortex(OwnLink(address(arm, closes_after_s=0.2)))
    kortex.open()
    until(lambda: not arm.look()["sessions"])
    kortex.keep_alive()
    until(lambda: "closed the session" in kortex.loss_reason)
    kortex.close()


def test_a_lost_datagram_is_no_lost_connection_and_many_are(link: Link, arm: FakeProcess) -> None:
    kortex = Kortex(link)
    kortex.open()
    arm.set(FaultInjection(lose_feedback=2))
    lost = 0
    for _ in range(6):
        try:
            kortex.feedback()
        except NoAnswer:
            lost += 1
    assert 3 <= lost < 6  # On a busy machine another may be late.
    assert not kortex.loss_reason
    arm.set(FaultInjection(lose_feedback=10**6))
    for _ in range(40):
        with pytest.raises(NoAnswer):
            kortex.feedback()
    assert "over UDP" in kortex.loss_reason


def test_slow_answers_are_waited_for_and_belong_to_their_calls(kortex: Kortex, arm: FakeProcess) -> None:
    arm.set(FaultInjection(delay_s=0.05))
    found: list[int] = []
    threads = [threading.Thread(target=lambda: found.append(kortex.joint_count())) for _ in range(4)]
    for thread in threads:
        thread.start()
    assert kortex.firmware()
    for thread in threads:
        thread.join()
    assert found == [7] * 4


def test_closing_ends_both_sessions_and_threads(arm: FakeProcess) -> None:
    kortex = Kortex(OwnLink(address(arm)))
    kortex.open()
    assert len(arm.look()["sessions"]) == 2
    kortex.close()
    assert arm.look()["sessions"] == []
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("dipac kinova")]


def test_without_its_wheel_kinova_s_client_says_where_it_is(arm: FakeProcess) -> None:
    if importlib.util.find_spec("kortex_api") is not None:
        pytest.skip("kortex_api is installed: the tests above are made with it")
    with pytest.raises(PreflightError, match=r"protobuf==3\.20\.3.*--no-deps"):
        OfficialLink(address(arm))
