"""The site's configuration: ranges that are checked, a box that contains what it should."""

import math

import numpy as np
import pytest

from app.config import Limits, Site, Timing, Workspace
from app.core.bounds import check_range
from app.core.errors import ParameterError


@pytest.mark.parametrize("value", [0.0, 0.5, 1.0])
def test_a_value_in_its_range_passes_unchanged(value):
    assert check_range("friction", value, 0.0, 1.0) == value


@pytest.mark.parametrize("value", [-1e-9, 1.0 + 1e-9, math.nan, math.inf, -math.inf])
def test_a_value_outside_its_range_or_not_finite_is_refused_by_name(value):
    with pytest.raises(ParameterError, match=r"friction = .* is outside its range 0 to 1"):
        check_range("friction", value, 0.0, 1.0)


def test_the_workspace_contains_its_corners_and_nothing_beyond():
    box = Workspace()
    low, high = np.array(box.low), np.array(box.high)
    assert box.contains(np.stack([low, high, (low + high) / 2]))
    for axis in range(3):
        for corner, outward in ((low, -1e-6), (high, 1e-6)):
            beyond = corner.copy()
            beyond[axis] += outward
            assert not box.contains(beyond)
            assert not box.contains(np.stack([(low + high) / 2, beyond]))


def test_the_workspace_contains_no_point_that_is_not_a_number():
    assert not Workspace().contains(np.array([0.5, math.nan, 0.1]))


def test_the_arm_stays_above_the_table_and_is_fed_well_within_its_watchdog():
    assert Workspace().low[2] > 0.0
    assert Limits().speed_m_s > 0.0
    timing = Timing()
    assert timing.arm_period_s < timing.keepalive_s < timing.watchdog_s / 2
    assert 0.0 < Site().travel_height_m < Workspace().high[2]


def test_the_console_is_for_this_machine_alone_unless_told_otherwise():
    assert Site().console_host == "127.0.0.1"
