"""Timestamps of a camera's clock as monotonic time, with the bound of their error."""

import numpy as np
import pytest

from app.rig.realsense.sdk.timestamping import GLOBAL_ERROR_S, ClockReading, Dated, Dating, Domain

PERIOD_S = 1 / 30
CALENDAR_S = 1.7e9
"""Calendar time minus monotonic time [s]."""


def moment(monotonic_s: float) -> ClockReading:
    return ClockReading(monotonic_s=monotonic_s, calendar_s=monotonic_s + CALENDAR_S, error_s=2e-6)


def dated(stamps, arrivals, domain: Domain) -> list[Dated | None]:
    found, dating = list[Dated | None](), Dating(period_s=PERIOD_S)
    for stamp_s, arrival_s in zip(stamps, arrivals, strict=True):
        one, dating = dating.date(float(stamp_s), domain, moment(float(arrival_s)))
        found.append(one)
    return found


def test_the_clocks_of_this_machine_are_read_together_within_a_millisecond() -> None:
    """The least of several tries: any one may be interrupted."""
    assert min(ClockReading.now().error_s for _ in range(50)) < 1e-3


@pytest.mark.parametrize(("domain", "error_s"), [("global", GLOBAL_ERROR_S), ("system", PERIOD_S)])
def test_a_date_of_the_calendar_is_when_it_says(domain: Domain, error_s: float) -> None:
    taken = np.arange(10) * PERIOD_S + 500
    for truth, one in zip(taken, dated(taken + CALENDAR_S, taken + 0.03, domain), strict=True):
        assert one is not None
        assert one.by == "calendar"
        assert one.time_s == pytest.approx(truth, abs=1e-6)
        assert error_s <= one.error_s < error_s + 1e-4


def test_an_image_from_the_future_is_of_now_at_the_latest() -> None:
    (one,) = dated([500.04 + CALENDAR_S], [500.0], "global")
    assert one is not None
    assert (one.time_s, one.by) == (500.0, "calendar")
    assert one.error_s == pytest.approx(0.04, abs=1e-4)


@pytest.mark.parametrize("wrong_s", [60.0, -3600.0, 50 * 365 * 86400.0])
def test_a_calendar_that_cannot_be_right_is_not_believed(wrong_s: float) -> None:
    taken = np.arange(10) * PERIOD_S + 500
    for truth, one in zip(taken, dated(taken + CALENDAR_S + wrong_s, taken + 0.03, "global"), strict=True):
        assert one is not None
        assert one.by == "arrival"
        assert abs(one.time_s - truth) <= one.error_s + 1e-6


def test_a_hardware_clock_is_dated_by_the_least_delay_so_that_jitter_does_not_show() -> None:
    rng = np.random.default_rng(0)
    taken = np.arange(600) * PERIOD_S + 500
    arrivals = taken + 0.010 + rng.exponential(0.02, taken.size)
    found = dated(taken * (1 + 50e-6) - 321.0, arrivals, "hardware")
    times = np.array([one.time_s for one in found if one is not None])
    assert np.all(np.abs(times - taken) <= PERIOD_S)
    assert np.std((times - taken)[100:]) < 1e-3
    assert np.all(times <= arrivals)


def test_a_stamp_that_stays_is_no_new_image() -> None:
    found = dated([10.0, 10.0, 10.1, 10.1 + 1e-6], [500.0, 500.03, 500.1, 500.2], "hardware")
    assert [one is None for one in found] == [False, True, False, True]


def test_a_clock_that_begins_anew_is_learned_anew() -> None:
    before, after = np.arange(5) * PERIOD_S + 900.0, np.arange(5) * PERIOD_S + 2.0
    arrivals = np.concatenate([np.arange(5) * PERIOD_S + 500.0, np.arange(5) * PERIOD_S + 507.0])
    found = dated([*before, *after], arrivals, "hardware")
    assert [one.time_s for one in found if one is not None] == pytest.approx(list(arrivals))


def test_a_drift_is_followed() -> None:
    """A camera that runs for an hour with a clock 50 ppm fast stays within its bound all the time."""
    taken = np.arange(0, 3600, 0.5) + 500
    found = dated(taken * (1 - 50e-6), taken + 0.01, "hardware")
    assert all(
        one is not None and abs(one.time_s - truth) <= one.error_s for one, truth in zip(found, taken, strict=True)
    )
