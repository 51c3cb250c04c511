"""An arm whose process runs late counts what it reads as of when it may have come, and not as of when it reads it."""

import numpy as np
import pytest

from app.arm.memory import ArmMemory, encode_motion
from app.arm.process import ControlLoop
from app.config import Site
from app.core.motion import Motion, pointing_down
from app.rig.simulated.arm_control import ArmControl

SITE = Site()
PERIOD_S, WATCHDOG_S = SITE.timing.arm_period_s, SITE.timing.watchdog_s
LATE_S = 0.1


class Moving:
    """An arm on a long way, kept going by keep-alives."""

    def __init__(self) -> None:
        self.memory, self.now_s = ArmMemory(), 100.0
        self.control = ArmControl(SITE, pointing_down(np.array([0.45, -0.2, 0.2])))
        self.loop = ControlLoop(self.memory, SITE, self.control)
        motion = Motion(positions=np.array([[0.45, 0.2, 0.1]]), speeds=np.array([SITE.limits.speed_m_s]))
        self.memory.motions.append(digest=motion.digest().encode(), **encode_motion(motion))
        for _ in range(50):
            self.memory.keepalives.value += 1
            self.tick(PERIOD_S)
        assert self.control.mode == "moving"

    def tick(self, elapsed_s: float) -> None:
        self.now_s += elapsed_s
        self.loop.tick(self.now_s, elapsed_s)

    def lasts_s(self) -> float:
        """Time until it stops, without a further word."""
        began_s = self.now_s
        while self.control.mode == "moving":
            self.tick(PERIOD_S)
            assert self.now_s < began_s + 1.0
        return self.now_s - began_s


def test_in_time_it_goes_on_for_the_watchdog_s_time_after_the_last_word() -> None:
    arm = Moving()
    arm.memory.keepalives.value += 1
    arm.tick(PERIOD_S)
    assert WATCHDOG_S - PERIOD_S <= arm.lasts_s() <= WATCHDOG_S + 2 * PERIOD_S


def test_a_motion_that_was_read_late_may_have_come_as_long_before() -> None:
    arm = Moving()
    further = Motion(positions=np.array([[0.45, -0.2, 0.1]]), speeds=np.array([SITE.limits.speed_m_s]))
    for _ in range(400):
        arm.memory.keepalives.value += 1
        arm.tick(PERIOD_S)
    assert arm.control.mode == "idle"
    arm.memory.motions.append(digest=further.digest().encode(), **encode_motion(further))
    arm.memory.keepalives.value += 1
    arm.tick(LATE_S)
    assert arm.control.mode == "moving"
    assert arm.lasts_s() <= WATCHDOG_S - LATE_S + 3 * PERIOD_S


def test_a_word_that_was_read_late_may_have_come_as_long_before() -> None:
    arm = Moving()
    arm.memory.keepalives.value += 1
    arm.tick(LATE_S)
    assert arm.lasts_s() <= WATCHDOG_S - LATE_S + 3 * PERIOD_S


def test_as_many_words_as_come_in_that_time_are_of_all_of_it() -> None:
    arm = Moving()
    arm.memory.keepalives.value += round(LATE_S / SITE.timing.keepalive_s)
    arm.tick(LATE_S)
    assert arm.lasts_s() >= WATCHDOG_S - 2 * SITE.timing.keepalive_s


@pytest.mark.parametrize("words", [10, 1000])
def test_more_words_than_there_is_time_for_are_of_now_and_not_of_later(words: int) -> None:
    arm = Moving()
    arm.memory.keepalives.value += words
    arm.tick(LATE_S)
    assert arm.lasts_s() <= WATCHDOG_S + 2 * PERIOD_S
