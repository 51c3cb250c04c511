"""After any fault between the program and a Gen3, the arm rests in time and was sent nothing out of bounds."""

import time
from collections.abc import Callable
from functools import cache

import numpy as np
import pytest

from app.rig.kinova.client.client import OwnLink
from app.rig.kinova.emulator.adversity import FaultInjection
from app.rig.kinova.emulator.process import FakeProcess
from app.rig.kinova.kortex import Kortex
from bench.faults.application import FAULTS, Doing
from bench.faults.gen3 import SITE, Wire, disturbed, suffered
from bench.faults.inject import Outcome
from bench.faults.place import KEPT_OUT
from tests.rig.kinova.conftest import address, way

pytestmark = pytest.mark.serial

REST_MS = 250.0
WIRE = ("cut", "deaf", "feedback lost", "another commands", "joint fault", "base fault", "pushed hard")


@cache
def outcomes(doing: Doing) -> dict[str, Outcome]:
    """Outcomes of the faults on the wire, each injected once."""
    return {each.fault: each for each in suffered(doing, alone=True)}


@pytest.mark.parametrize("doing", FAULTS)
@pytest.mark.parametrize("fault", WIRE)
def test_the_arm_is_at_rest_soon_after_a_fault_at_the_wire_and_nothing_told_there_left_the_limits(
    doing: Doing, fault: str
) -> None:
    outcome = outcomes(doing)[fault]
    assert outcome.rest_ms <= REST_MS
    assert outcome.within


def test_a_command_or_a_tool_out_of_bounds_is_seen_at_the_wire() -> None:
    away, beside = np.array([0.0, 0.0, 0.09]), np.zeros(3)
    outside = way(0.45, 0.0, SITE.limits.workspace.high[2] + 0.01, speed=0.05)
    through = way(*KEPT_OUT.high[:2], 0.1, speed=0.05), way(*KEPT_OUT.low[:2], 0.1, speed=0.05)
    tried: list[Callable[[Kortex], None]] = [
        lambda arm: arm.twist(away, beside),
        lambda arm: arm.twist(2 * away, beside),
        lambda arm: arm.twist(away, np.array([0.0, 0.0, 1.1])),
        lambda arm: arm.go([outside]),
        lambda arm: arm.go(through),
    ]
    with FakeProcess() as fake:
        seen, arm = Wire(fake, SITE.limits), Kortex(OwnLink(address(fake)))
        arm.open()
        found = list[bool]()
        for told in tried:
            begun_s = time.monotonic()
            told(arm)
            found.append(seen.within(begun_s))
        arm.close()
    assert found == [True, False, False, False, False]


@pytest.mark.slow
@pytest.mark.parametrize("doing", FAULTS)
def test_so_it_is_after_every_fault_of_the_application_time_and_again(doing: Doing) -> None:
    found = [each for _ in range(5) for each in suffered(doing)]
    assert [each for each in found if each.rest_ms > REST_MS or not each.within] == []


@pytest.mark.slow
@pytest.mark.timeout(600)
@pytest.mark.parametrize("doing", FAULTS)
def test_one_lost_packet_of_a_hundred_stops_nothing_in_minutes(doing: Doing) -> None:
    stops = disturbed(doing, 150.0, FaultInjection(loss=0.01))
    # What the application says too late for, on a busy machine, is not the wire's.
    assert [why for why in stops if not why.startswith("Watchdog")] == []
