"""Whatever goes wrong in the application or around it, the arm is at rest in time and never leaves its limits."""

import pytest

from bench.faults.__main__ import every
from bench.faults.application import FAULTS, Doing
from bench.faults.inject import Outcome, faults

pytestmark = pytest.mark.serial

REST_MS = 250.0
CASES = [(doing, fault) for doing in FAULTS for fault in faults(doing)]


@pytest.fixture(scope="module")
def outcomes() -> list[Outcome]:
    return every(1)


@pytest.mark.parametrize(("doing", "fault"), CASES)
def test_the_arm_is_at_rest_soon_after_a_fault_and_no_command_left_its_limits(
    outcomes: list[Outcome], doing: Doing, fault: str
) -> None:
    (outcome,) = (each for each in outcomes if (each.doing, each.fault) == (doing, fault))
    assert outcome.rest_ms <= REST_MS
    assert outcome.within


@pytest.mark.slow
def test_so_it_is_after_two_hundred_faults() -> None:
    outcomes = every(9)
    assert len(outcomes) >= 200
    assert [each for each in outcomes if each.rest_ms > REST_MS or not each.within] == []
