"""Fingers whose motor draws more than it may stay where they are, whoever closes them, until they are opened."""

import dataclasses
import threading
import time
from collections.abc import Iterator

import numpy as np
import pytest

from app.config import Limits, Site
from app.core.dialogue.jog import Jog
from app.rig.kinova.control import KinovaControl, connect_arm
from app.rig.kinova.emulator.adversity import FaultInjection
from app.rig.kinova.emulator.process import FakeProcess
from app.rig.kinova.feedback_conversion import ArmFeedback, feedback_of
from app.rig.kinova.grip import Grip
from app.rig.kinova.kortex import Kortex
from tests.rig.kinova.conftest import address, until

pytestmark = pytest.mark.serial

MOST_MA = 300.0
SITE = Site(limits=Limits(speed_m_s=0.25, gripper_ma=MOST_MA))
OPEN_M = SITE.limits.opening_m
OBJECT = 0.5


def told(arm: FakeProcess) -> list[float]:
    """Positions that the fingers were commanded to, in order."""
    return [each["value"] for each in arm.commands() if each["call"] == "SendGripperCommand"]


@pytest.fixture
def control(arm: FakeProcess) -> Iterator[KinovaControl]:
    arm.set(FaultInjection(object_at=OBJECT))
    control = connect_arm(address(arm), SITE)
    yield control
    control.close()
    arm.set(FaultInjection())


def fingers(control: KinovaControl, opening_m: float) -> None:
    """Move the fingers alone, and wait for their end."""
    here = control.measured.copy()
    points = np.array([here, here])
    points[1, 7] = opening_m
    control.begin(points, np.array([0.1]))
    until(lambda: not control.advance(0.01) and control.mode != "moving")
    assert control.mode == "idle", control.reason


def test_fingers_that_close_on_something_press_no_longer_than_it_takes_to_notice(
    control: KinovaControl, arm: FakeProcess
) -> None:
    fingers(control, 0.0)
    until(lambda: len(told(arm)) == 2)
    first, second = told(arm)
    assert first == 1.0
    assert second == pytest.approx(OBJECT, abs=0.01)
    until(lambda: arm.look()["current_ma"] < MOST_MA)
    assert arm.look()["fingers"] == pytest.approx(OBJECT, abs=0.01)


def test_what_was_gripped_is_not_pressed_again_before_the_fingers_have_opened(
    control: KinovaControl, arm: FakeProcess
) -> None:
    fingers(control, 0.0)
    until(lambda: len(told(arm)) == 2)
    fingers(control, 0.3 * OPEN_M)
    assert told(arm)[-1] <= OBJECT + 1e-6
    fingers(control, OPEN_M)
    assert arm.look()["fingers"] < 0.05
    arm.set(FaultInjection())
    fingers(control, 0.3 * OPEN_M)
    assert told(arm)[-1] == pytest.approx(0.7, abs=1e-6)
    assert arm.look()["fingers"] == pytest.approx(0.7, abs=0.03)


def test_a_hand_that_closes_the_fingers_presses_no_harder(control: KinovaControl, arm: FakeProcess) -> None:
    end = time.monotonic() + 2.0
    while time.monotonic() < end:
        control.jog(Jog(opening=-0.06))
        control.advance(0.01)
        time.sleep(0.01)
    until(lambda: arm.look()["current_ma"] < MOST_MA)
    # It is told to be 13 mm of 85 ahead of the fingers at most, until the current has been too high for a while.
    assert max(told(arm)) < OBJECT + 0.16
    assert told(arm)[-1] <= OBJECT + 0.01


def test_where_no_current_is_too_high_fingers_close_as_they_are_told(arm: FakeProcess) -> None:
    arm.set(FaultInjection(object_at=OBJECT))
    free = dataclasses.replace(SITE, limits=dataclasses.replace(SITE.limits, gripper_ma=None))
    control = connect_arm(address(arm), free)
    fingers(control, 0.0)
    assert arm.look()["current_ma"] > MOST_MA
    assert told(arm) == [1.0]
    control.close()
    arm.set(FaultInjection())


@pytest.fixture
def measured(kortex: Kortex) -> ArmFeedback:
    found = feedback_of(kortex.feedback(), 0.0, OPEN_M)
    assert found is not None
    return found


def looked(kortex: Kortex, arm: FakeProcess, measured: ArmFeedback, currents_ma: list[float]) -> list[float]:
    """Commands to fingers that draw these currents, one every 10 ms, while they are closed by 0.6."""
    grip, over = Grip(kortex, MOST_MA), threading.Event()
    thread = threading.Thread(target=grip.watch, args=(over,))
    thread.start()
    for tick, current in enumerate(currents_ma):
        grip.look(dataclasses.replace(measured, time_s=10.0 + 0.01 * tick, gripper_ma=current, closed=0.6))
        time.sleep(0.01)
    time.sleep(0.05)
    over.set()
    grip.end()
    thread.join()
    return told(arm)


def test_a_peak_as_the_fingers_set_out_is_none_that_presses(
    kortex: Kortex, arm: FakeProcess, measured: ArmFeedback
) -> None:
    assert looked(kortex, arm, measured, [900.0, 900.0, 900.0, 20.0] * 10) == []


def test_fingers_that_press_on_where_they_stand_give_way_step_by_step(
    kortex: Kortex, arm: FakeProcess, measured: ArmFeedback
) -> None:
    assert looked(kortex, arm, measured, [900.0] * 65) == pytest.approx([0.6, 0.596, 0.596], abs=1e-5)
