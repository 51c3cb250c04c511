"""Whatever goes wrong between the program and a Gen3, the arm is at rest in time and was told nothing out of bounds."""

from functools import cache

import pytest

from app.rig.kinova.fake.adversity import Adversity
from bench.faults.application import FAULTS, Doing
from bench.faults.gen3 import disturbed, suffered
from bench.faults.inject import Outcome

REST_MS = 250.0
WIRE = ("cut", "deaf", "feedback lost", "another commands", "joint fault", "base fault", "pushed hard")


@cache
def outcomes(doing: Doing) -> dict[str, Outcome]:
    """Of the faults at the wire, each done once."""
    return {each.fault: each for each in suffered(doing, alone=True)}


@pytest.mark.parametrize("doing", FAULTS)
@pytest.mark.parametrize("fault", WIRE)
def test_the_arm_is_at_rest_soon_after_a_fault_at_the_wire_and_nothing_told_there_left_the_limits(
    doing: Doing, fault: str
) -> None:
    outcome = outcomes(doing)[fault]
    assert outcome.rest_ms <= REST_MS
    assert outcome.within


@pytest.mark.slow
@pytest.mark.parametrize("doing", FAULTS)
def test_so_it_is_after_every_fault_of_the_application_time_and_again(doing: Doing) -> None:
    found = [each for _ in range(5) for each in suffered(doing)]
    assert [each for each in found if each.rest_ms > REST_MS or not each.within] == []


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("doing", FAULTS)
def test_one_lost_packet_of_a_hundred_stops_nothing_in_minutes(doing: Doing) -> None:
    stops = disturbed(doing, 150.0, Adversity(loss=0.01))
    # What the application says too late for, on a busy machine, is not the wire's.
    assert [why for why in stops if not why.startswith("Watchdog")] == []
