"""A Gen3 under control: what it is told goes to the arm within the limits, and whatever goes wrong ends at rest."""

import dataclasses
import threading
import time
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np
import pytest

from app.config import KeepOut, Limits, Site, Workspace
from app.core.dialogue.jog import Jog
from app.core.errors import DeviceError, MotionRefused
from app.core.geometry.table_place import TablePlace
from app.core.motion import pointing_down
from app.core.rejection_codes import Refusal
from app.rig.kinova import gen3
from app.rig.kinova.client.client import OwnLink
from app.rig.kinova.control import KinovaControl, connect_arm
from app.rig.kinova.emulator.adversity import FaultInjection
from app.rig.kinova.emulator.process import FakeProcess
from app.rig.kinova.kortex import Kortex
from tests.rig.kinova.conftest import PATIENT_S, address, tool, until

pytestmark = pytest.mark.serial

STAND = KeepOut(name="stand", low=(0.6, 0.25, 0.0), high=(0.7, 0.35, 0.4))
BOX = Workspace(low=(0.3, -0.3, 0.02), high=(0.6, 0.3, 0.4))
SITE = Site(limits=Limits(speed_m_s=0.25, workspace=BOX, keep_out=(STAND,)))
START = (0.45, 0.0, 0.3)


class Loop:
    """Ticks as the arm's process does, until it hangs or ends."""

    def __init__(self, control: KinovaControl) -> None:
        self.control, self.hangs = control, threading.Event()
        self._over, self.lock = threading.Event(), threading.Lock()
        self.longest_s = 0.0
        self.reasons = [""]
        self._thread = threading.Thread(target=self._run)
        self._thread.start()

    def _run(self) -> None:
        while not self._over.wait(0.01):
            if self.hangs.is_set():
                continue
            with self.lock:
                begun = time.thread_time()
                self.control.advance(0.01)
                self.longest_s = max(self.longest_s, time.thread_time() - begun)
                if self.control.reason != self.reasons[-1]:
                    self.reasons.append(self.control.reason)

    def end(self) -> None:
        self._over.set()
        self._thread.join()
        self.control.close()

    def go(self, *positions: tuple[float, float, float], speed: float = 0.25, openings: tuple[float, ...] = ()) -> None:
        """Begin a motion from where the tool is, once what it shall do has come to that after a stop."""
        until(lambda: np.linalg.norm(self.control.commanded[:3] - self.control.measured[:3]) < 5e-3)
        points = np.array([self.control.measured, *(pointing_down(np.array(each)) for each in positions)])
        if openings:
            points[:, 7] = openings
        with self.lock:
            self.control.begin(points, np.full(len(positions), speed))

    def do(self, what, *arguments):
        with self.lock:
            return what(*arguments)

    def comes_to(self, mode: str, seconds: float = 30.0) -> None:
        try:
            until(lambda: self.control.mode == mode, seconds)
        except AssertionError:
            raise AssertionError(f"{self.control.mode} instead of {mode}: {self.control.reason}") from None


@pytest.fixture
def loop(arm: FakeProcess) -> Iterator[Loop]:
    loop = Loop(connect_arm(address(arm, stops_after_s=PATIENT_S), SITE))
    yield loop
    arm.set(FaultInjection())
    loop.end()


@contextmanager
def pressed_on_and_on(loop: Loop) -> Iterator[None]:
    """STOP every 5 ms."""
    over = threading.Event()

    def press() -> None:
        while not over.wait(0.005):
            loop.do(loop.control.stop, "STOP was pressed.")

    thread = threading.Thread(target=press)
    thread.start()
    try:
        yield
    finally:
        over.set()
        thread.join()


def fastest(arm: FakeProcess) -> float:
    return max((each["linear_m_s"] for each in arm.commands()), default=0.0)


def test_taking_hold_of_an_arm_sets_its_own_limits_and_zones(loop: Loop, arm: FakeProcess) -> None:
    other = Kortex(OwnLink(address(arm)))
    other.open()
    assert other.forbidden().keys() == {"dipac stand"}
    other.forbid("somebody's", (0.0, 0.0, 2.0), (1.0, 1.0, 1.0))
    other.forbid("dipac earlier", (0.0, 0.0, 2.0), (1.0, 1.0, 1.0))
    connect_arm(address(arm), SITE).close()
    assert other.forbidden().keys() == {"dipac stand", "somebody's"}
    other.close()
    control = loop.control
    assert control.mode == "idle"
    assert control.measured[:3] == pytest.approx(START, abs=1e-3)
    assert control.measured[3:7] == pytest.approx([0, 1, 0, 0], abs=1e-3)
    assert control.measured[7] == pytest.approx(SITE.limits.opening_m)
    assert gen3.tool(control.joints)[:3, 3] == pytest.approx(control.measured[:3], abs=1e-3)


def test_no_arm_is_said_before_anything_runs(arm: FakeProcess) -> None:
    with pytest.raises(DeviceError, match="check its power"):
        connect_arm(dataclasses.replace(address(arm), tcp_port=1), SITE)


def test_an_arm_beside_a_table_that_is_lower_turned_and_shifted_is_told_in_the_frame_of_its_base(
    arm: FakeProcess,
) -> None:
    table = TablePlace(place_m=(0.05, -0.2, -0.15), turn_deg=30.0)
    turn = table.base_from_table[:3, :3]

    def in_base(place: tuple[float, float, float]) -> np.ndarray:
        return turn @ place + table.place_m

    box = Workspace(low=(0.3, -0.3, 0.02), high=(0.7, 0.4, 0.5))
    site = Site(limits=Limits(speed_m_s=0.25, workspace=box, keep_out=(STAND,)), table=table)
    loop = Loop(connect_arm(address(arm, stops_after_s=PATIENT_S), site))
    try:
        assert in_base(tuple(loop.control.measured[:3])) == pytest.approx(START, abs=1e-3)
        way = [(0.45, 0.1, 0.2), (0.55, -0.05, 0.05)]
        loop.go(*way)
        loop.comes_to("idle")
        assert loop.control.measured[:3] == pytest.approx(way[-1], abs=2e-3)
        assert loop.control.measured[3:7] == pytest.approx([0, 1, 0, 0], abs=1e-3)
        assert tool(arm) == pytest.approx(in_base(way[-1]), abs=2e-3)
        (told,) = [each for each in arm.commands() if each["call"] == "ExecuteAction"]
        assert told["positions"] == [pytest.approx(in_base(each), abs=1e-6) for each in way]
        # By hand along the table's x.
        before = tool(arm)
        until(lambda: loop.do(loop.control.jog, Jog(linear=np.array([-0.1, 0.0, 0.0]))) and moved_m(arm, before) > 0.02)
        loop.do(loop.control.decelerate)
        loop.comes_to("idle")
        way_made = tool(arm) - before
        assert way_made @ turn[:, 0] == pytest.approx(-np.linalg.norm(way_made), rel=0.02)
        # What is kept free lies in the table's frame, and the arm breaks off a way into it.
        loop.go((0.65, 0.3, 0.2))
        loop.comes_to("stopped")
        there = turn.T @ (tool(arm) - table.place_m)
        beyond = np.maximum(np.array(STAND.low) - there, there - STAND.high).clip(min=0)
        assert 0 < np.linalg.norm(beyond) < 0.02
    finally:
        loop.end()


def moved_m(arm: FakeProcess, before: np.ndarray) -> float:
    return float(np.linalg.norm(tool(arm) - before))


def test_a_motion_goes_through_its_points_within_the_limits_and_ends_idle(loop: Loop, arm: FakeProcess) -> None:
    way = [(0.45, 0.1, 0.25), (0.5, 0.1, 0.25), (0.5, -0.05, 0.15)]
    loop.go(*way)
    assert loop.control.mode == "moving"
    loop.comes_to("idle")
    assert tool(arm) == pytest.approx(way[-1], abs=2e-3)
    until(lambda: loop.control.commanded[:3] == pytest.approx(way[-1]))
    (told,) = [each for each in arm.commands() if each["call"] == "ExecuteAction"]
    assert told["positions"] == [pytest.approx(each, abs=1e-6) for each in way]
    assert fastest(arm) <= SITE.limits.speed_m_s * (1 + 1e-6)
    assert loop.longest_s < 0.5


def test_a_way_that_the_arm_cannot_go_ends_before_anything_moves(loop: Loop, arm: FakeProcess) -> None:
    before = tool(arm)
    loop.go((0.45, 0.1, 0.25), (0.9, 0.3, 0.3))
    loop.comes_to("idle")
    refusal = loop.do(loop.control.refusal)
    assert refusal.code == Refusal.UNREACHABLE
    assert "outside of what the arm reaches" in refusal.sentence
    assert loop.do(loop.control.refusal) is None
    assert tool(arm) == pytest.approx(before, abs=1e-6)
    assert not [each for each in arm.commands() if each["call"] in ("Stop", "ExecuteAction")]


def test_a_stop_ends_a_motion_and_holds_until_it_is_lifted(loop: Loop, arm: FakeProcess) -> None:
    loop.go((0.45, 0.0, 0.1), speed=0.05)
    until(lambda: loop.control.velocity[2] < -0.02)
    loop.do(loop.control.stop, "STOP was pressed.")
    loop.comes_to("stopped")
    assert loop.control.reason == "STOP was pressed."
    until(lambda: not arm.look()["moving"])
    assert 0.1 < tool(arm)[2] < 0.3
    loop.do(loop.control.reset)
    loop.comes_to("idle")
    loop.go((0.45, 0.0, 0.2))
    loop.comes_to("idle")
    assert tool(arm)[2] == pytest.approx(0.2, abs=2e-3)


def test_an_arm_that_refuses_to_stop_is_cut_off_and_commanded_no_more(loop: Loop, arm: FakeProcess) -> None:
    loop.go((0.45, 0.0, 0.1), speed=0.02)
    until(lambda: loop.control.velocity[2] < -0.01)
    arm.set(FaultInjection(denies="Stop"))
    with pressed_on_and_on(loop):  # As a key does that is held: each is said to the arm.
        until(lambda: "refuses to stop" in loop.control.reason)
        assert loop.control.mode == "fault"
        until(lambda: not arm.look()["moving"], PATIENT_S + 3.0)
    assert tool(arm)[2] > 0.2
    told = len(arm.commands())
    arm.set(FaultInjection())
    loop.do(loop.control.reset)
    time.sleep(0.3)
    assert loop.control.mode == "fault"
    assert len(arm.commands()) == told


def test_an_arm_that_refuses_a_stop_while_it_thinks_is_cut_off_as_it_sets_out(loop: Loop, arm: FakeProcess) -> None:
    arm.set(FaultInjection(thinks_s=1.0, denies="Stop"))
    loop.go((0.45, 0.0, 0.1), speed=0.02)
    until(lambda: any(each["call"] == "ExecuteAction" for each in arm.commands()))
    loop.do(loop.control.stop, "STOP was pressed.")
    loop.comes_to("stopped")
    until(lambda: "refuses to stop" in loop.control.reason)
    assert loop.control.mode == "fault"
    until(lambda: not arm.look()["moving"], PATIENT_S + 3.0)
    assert tool(arm)[2] > 0.2


def test_a_stop_that_an_arm_refuses_because_it_is_in_fault_cuts_nothing_off(loop: Loop, arm: FakeProcess) -> None:
    loop.go((0.45, 0.0, 0.1), speed=0.05)
    until(lambda: loop.control.velocity[2] < -0.02)
    arm.set(FaultInjection(denies="Stop"))
    arm.fail(joint=4, bits=1 << 5)
    loop.comes_to("fault")
    time.sleep(0.3)
    arm.set(FaultInjection())
    loop.do(loop.control.reset)
    loop.comes_to("idle")


def test_a_stop_right_after_the_beginning_is_not_overtaken_by_it(loop: Loop, arm: FakeProcess) -> None:
    for wait_s in (0.0, 0.01, 0.03, 0.06):
        loop.go((0.45, 0.0, 0.1), speed=0.02)
        time.sleep(wait_s)
        loop.do(loop.control.stop, "STOP was pressed.")
        loop.comes_to("stopped")
        time.sleep(0.15)
        until(lambda: not arm.look()["moving"])
        rest = tool(arm)
        time.sleep(0.1)
        assert tool(arm) == pytest.approx(rest, abs=1e-6)
        loop.do(loop.control.reset)
        loop.comes_to("idle")


def test_an_end_that_was_not_reached_is_noticed(loop: Loop, arm: FakeProcess) -> None:
    arm.set(FaultInjection(short_m=0.03))
    loop.go((0.45, 0.0, 0.2))
    loop.comes_to("stopped")
    assert "says that it has arrived" in loop.control.reason
    assert tool(arm)[2] == pytest.approx(0.23, abs=5e-3)


def test_fingers_close_on_something_between_two_stretches(loop: Loop, arm: FakeProcess) -> None:
    arm.set(FaultInjection(object_at=0.5))
    at, open_m = (0.45, 0.0, 0.25), SITE.limits.opening_m
    loop.go(at, at, START, openings=(open_m, open_m, 0.0, 0.0))
    loop.comes_to("idle")
    assert arm.look()["fingers"] == pytest.approx(0.5)
    assert loop.control.measured[7] == pytest.approx(open_m / 2, abs=1e-3)
    order = [each["call"] for each in arm.commands() if each["call"] in ("ExecuteAction", "SendGripperCommand")]
    assert order == ["ExecuteAction", "SendGripperCommand", "ExecuteAction"]


def hold(loop: Loop, jog: Jog, seconds: float) -> None:
    """Keep saying it, as a hand on a key does."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        loop.do(loop.control.jog, jog)
        time.sleep(0.02)


def test_a_hand_moves_the_tool_and_letting_go_brings_it_to_rest(loop: Loop, arm: FakeProcess) -> None:
    hold(loop, Jog(linear=np.array([0.0, 0.1, 0.0])), 0.8)
    assert loop.control.jogging
    assert loop.control.mode == "moving"
    assert tool(arm)[1] > 0.03
    loop.do(loop.control.decelerate)
    loop.comes_to("idle")
    until(lambda: not arm.look()["moving"])
    told = arm.commands()
    twists = [each["time_s"] for each in told if each["call"] == "SendTwistCommand"]
    assert len(twists) > 5
    assert len(twists) <= 2 + 40 * (twists[-1] - twists[0])
    assert told[-1]["call"] == "Stop"
    assert fastest(arm) < 0.1 + 0.021


def test_a_hand_that_wants_all_there_is_gets_no_more_over_the_wire_than_the_limit(loop: Loop, arm: FakeProcess) -> None:
    for toward in (1.0, -1.0):
        hold(loop, Jog(linear=np.array([0.0, toward * SITE.limits.speed_m_s, 0.0])), 0.9)
    told = fastest(arm)
    assert 0.8 * SITE.limits.speed_m_s < told <= SITE.limits.speed_m_s * (1 + 1e-6)


def test_a_hand_turns_the_tool_and_moves_the_fingers(loop: Loop, arm: FakeProcess) -> None:
    hold(loop, Jog(angular=np.array([0.0, 0.0, 0.5]), opening=-0.05), 0.8)
    loop.do(loop.control.decelerate)
    loop.comes_to("idle")
    assert loop.control.measured[7] < SITE.limits.opening_m - 0.01
    assert abs(loop.control.measured[6]) + abs(loop.control.measured[5]) > 0.05
    assert tool(arm) == pytest.approx(START, abs=0.01)


def test_a_hand_cannot_move_the_tool_out_of_the_workspace(loop: Loop, arm: FakeProcess) -> None:
    hold(loop, Jog(linear=np.array([0.0, 0.0, 0.25])), 1.5)
    assert tool(arm)[2] < SITE.limits.workspace.high[2] + 2e-3
    loop.do(loop.control.decelerate)
    loop.comes_to("idle")
    assert tool(arm)[2] < SITE.limits.workspace.high[2] + 2e-3


@pytest.mark.parametrize("by_hand", [True, False])
def test_an_arm_whose_loop_hangs_stops(loop: Loop, arm: FakeProcess, by_hand: bool) -> None:
    if by_hand:
        hold(loop, Jog(linear=np.array([0.0, 0.05, 0.0])), 0.3)
    else:
        loop.go((0.45, 0.25, 0.3), speed=0.02)
    until(lambda: np.linalg.norm(loop.control.velocity) > 0.01)
    loop.hangs.set()
    until(lambda: not arm.look()["moving"])
    assert tool(arm)[1] < 0.15


def test_a_stop_while_a_fault_is_being_cleared_stays_in_force(loop: Loop, arm: FakeProcess) -> None:
    loop.go((0.45, 0.0, 0.1), speed=0.02)
    until(lambda: arm.look()["moving"])
    arm.fail(joint=4, bits=1 << 5)
    loop.comes_to("fault")
    with loop.lock:
        loop.control.reset()
        loop.control.stop("STOP was pressed.")
    time.sleep(1.0)
    assert loop.control.mode == "fault"
    loop.do(loop.control.reset)
    loop.comes_to("idle")


def test_a_fault_is_said_in_words_and_cleared_by_resume(loop: Loop, arm: FakeProcess) -> None:
    loop.go((0.45, 0.0, 0.1), speed=0.02)
    until(lambda: arm.look()["moving"])
    arm.fail(joint=4, bits=1 << 5, lasting=True)
    loop.comes_to("fault")
    assert "Joint 4 met too much torque" in loop.control.reason
    with pytest.raises(MotionRefused, match="torque"):
        loop.go((0.45, 0.0, 0.2))
    loop.do(loop.control.reset)
    until(lambda: "still in fault" in loop.control.reason)
    arm.fail()
    loop.do(loop.control.reset)
    loop.comes_to("idle")
    assert loop.control.reason == ""


def test_an_emergency_stop_pressed_elsewhere_is_a_fault_too(loop: Loop, arm: FakeProcess) -> None:
    arm.fail(base=1 << 23)
    loop.comes_to("fault")
    assert "emergency stop" in loop.control.reason
    loop.do(loop.control.reset)
    loop.comes_to("idle")


def test_another_session_in_control_is_said(loop: Loop, arm: FakeProcess) -> None:
    arm.set(FaultInjection(foreign=True))
    loop.go((0.45, 0.0, 0.2))
    loop.comes_to("stopped")
    assert "another session has control" in loop.control.reason


@pytest.mark.parametrize("by_hand", [True, False])
def test_an_arm_that_somebody_else_commands_is_stopped_and_that_is_said(
    loop: Loop, arm: FakeProcess, by_hand: bool
) -> None:
    if by_hand:
        hold(loop, Jog(linear=np.array([0.0, 0.05, 0.0])), 0.5)
    else:
        loop.go((0.45, 0.25, 0.3), speed=0.05)
        until(lambda: np.linalg.norm(loop.control.velocity) > 0.03)
    arm.take_over(0.05)
    if by_hand:
        hold(loop, Jog(linear=np.array([0.0, 0.05, 0.0])), 0.3)
    loop.comes_to("stopped")
    assert "commands the arm" in loop.control.reason or "another session has control" in loop.control.reason
    until(lambda: not arm.look()["moving"])
    assert tool(arm)[2] < START[2] + 0.05


def test_an_arm_that_somebody_else_has_moved_goes_on_from_where_it_is(loop: Loop, arm: FakeProcess) -> None:
    arm.take_over(0.1)
    until(lambda: tool(arm)[2] > START[2] + 0.05)
    loop.do(loop.control.stop, "STOP was pressed.")
    until(lambda: not arm.look()["moving"])
    arm.set(FaultInjection())
    loop.do(loop.control.reset)
    loop.comes_to("idle")
    loop.go((0.45, 0.05, 0.35))
    loop.comes_to("idle")
    assert tool(arm) == pytest.approx((0.45, 0.05, 0.35), abs=2e-3)


def test_where_the_tool_shall_be_never_jumps_also_not_where_it_is_stopped(loop: Loop) -> None:
    shall = list[np.ndarray]()
    loop.go((0.45, 0.1, 0.3), (0.45, 0.1, 0.2), (0.45, -0.1, 0.2))
    advance = loop.control.advance

    def watched(duration_s: float) -> None:
        advance(duration_s)
        shall.append(loop.control.commanded[:3].copy())

    loop.control.advance = watched  # type: ignore[method-assign]
    until(lambda: loop.control.velocity[2] < -0.1)
    loop.do(loop.control.stop, "STOP was pressed.")
    loop.comes_to("stopped")
    until(lambda: np.linalg.norm(shall[-1] - loop.control.measured[:3]) < 1e-3)
    steps = np.linalg.norm(np.diff(shall, axis=0), axis=1)
    assert steps.max() <= SITE.limits.speed_m_s * 0.01 * (1 + 1e-6)


@pytest.mark.parametrize("deaf", [False, True])
def test_a_lost_connection_is_a_fault_and_is_made_again(loop: Loop, arm: FakeProcess, deaf: bool) -> None:
    loop.go((0.45, 0.0, 0.1), speed=0.02)
    until(lambda: arm.look()["moving"])
    arm.set(FaultInjection(deaf=True)) if deaf else arm.cut()
    loop.comes_to("fault")
    # It may be back before anybody looks, and the reason is noted after the mode.
    until(lambda: any(reason.startswith("The connection to the arm is ") for reason in loop.reasons))
    until(lambda: not arm.look()["moving"])
    arm.set(FaultInjection())
    until(lambda: "is back" in loop.control.reason)
    loop.do(loop.control.reset)
    loop.comes_to("idle")
    loop.go((0.45, 0.0, 0.28))
    loop.comes_to("idle")


def test_an_arm_that_says_no_more_where_it_is_stops(arm: FakeProcess) -> None:
    loop = Loop(connect_arm(address(arm), SITE))
    try:
        loop.go((0.45, 0.0, 0.1), speed=0.02)
        until(lambda: arm.look()["moving"])
        arm.set(FaultInjection(lose_feedback=10**9))
        until(lambda: loop.control.mode != "moving")
        assert "The arm has said nothing for 0.15 s" in loop.control.reason
        until(lambda: not arm.look()["moving"])
    finally:
        arm.set(FaultInjection())
        loop.end()


def test_a_push_at_the_tool_is_felt(loop: Loop, arm: FakeProcess) -> None:
    arm.set(FaultInjection(force_n=20.0))
    until(lambda: loop.control.force == pytest.approx([0, 0, 20.0]))


def test_letting_go_of_an_arm_that_moves_stops_it(arm: FakeProcess) -> None:
    loop = Loop(connect_arm(address(arm, stops_after_s=PATIENT_S), SITE))
    loop.go((0.45, 0.0, 0.1), speed=0.02)
    until(lambda: arm.look()["moving"])
    loop.end()
    until(lambda: not arm.look()["moving"])
    assert arm.look()["sessions"] == []
    assert not [thread for thread in threading.enumerate() if thread.name.startswith("dipac")]
