"""A cause's size: the length of its switches, with an interval that is never too narrow."""

import math
from itertools import product

import pytest

from app.discovery.dataset.model_under_test import catalogue
from app.discovery.results.case import CauseResult, Estimate
from app.report.drawing.size import size
from tests.ui.report import cases

CATALOGUE = catalogue()


def blamed(*estimates: Estimate) -> CauseResult:
    return cases.blame("table_tilt", "physics", "Tilt.", 0.5, 1.0, *estimates)


@pytest.mark.parametrize("cause", CATALOGUE.causes, ids=lambda cause: cause.name)
def test_the_switches_of_every_effect_are_its_leading_parameters_of_one_unit(cause) -> None:
    units = [CATALOGUE.specs[column].unit for column in cause.columns]
    leading = next((index for index, unit in enumerate(units) if unit != units[0]), len(units))
    assert leading == cause.switches


def test_a_single_switch_is_its_own_size_and_keeps_its_sign() -> None:
    drift = blamed(cases.estimate("friction_drift", -0.4, 0.1, "1/session"))
    whole = size(drift)
    assert (whole.value, whole.low, whole.high) == (-0.4, -0.5, pytest.approx(-0.3))


def test_what_says_where_does_not_count() -> None:
    pinned = blamed(
        cases.estimate("constraint_rate", 300.0, 50.0, "1/s"), cases.estimate("constraint_x", 0.5, 0.1, "m")
    )
    assert size(pinned).value == 300.0


def test_the_interval_of_a_length_holds_that_of_every_vector_within_the_parts_intervals() -> None:
    parts = (
        cases.estimate("a", 3.0, 1.0, "m"),
        cases.estimate("b", -0.5, 1.0, "m"),
        cases.estimate("c", 4.0, 0.5, "m"),
    )
    whole = size(blamed(*parts))
    assert whole.value == pytest.approx(math.hypot(3.0, 0.5, 4.0))
    ends = [(part.low, part.value, part.high) for part in parts]
    lengths = [math.hypot(*vector) for vector in product(*ends)]
    assert whole.low <= min(lengths)
    assert whole.high == pytest.approx(max(lengths))


def test_a_length_whose_parts_may_all_vanish_may_vanish() -> None:
    assert size(blamed(cases.estimate("a", 0.2, 1.0, "m"), cases.estimate("b", 0.1, 1.0, "m"))).low == 0.0


def test_without_estimates_there_is_no_size() -> None:
    assert math.isnan(size(blamed()).value)
