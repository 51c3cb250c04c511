"""Timestamping: exposure times in this machine's monotonic time, with an error bound. Pure.

A camera dates its images in one of three ways. *Global* time is the device's clock mapped to the host's calendar by the
SDK, which fits a line to round trips over USB; it adjusts that line by some milliseconds now and then (librealsense
issue 4505), and was seen up to 40 ms in the future (10068) and far off after long use (4505, 11320). *System* time is
the moment the host received the image. The *hardware* clock has an origin of its own.

So a calendar date is trusted only where it is neither in the future nor old. Any other stamp is dated by arrival: the
least recent delay is taken for zero, so such images are dated late by the shortest transfer through USB, which is less
than a period.
"""

import time
from dataclasses import dataclass, replace
from typing import Literal, Self, TypeAlias, final

Domain: TypeAlias = Literal["global", "system", "hardware"]

GLOBAL_ERROR_S = 0.005
_FUTURE_S, _OLD_S = 0.050, 3.0
_SAME = 0.1
_FORGET_S = 10.0
"""Window of the least delay [s]: crystal clocks drift apart by less than 1 ms in this time."""


@final
@dataclass(frozen=True, kw_only=True)
class ClockReading:
    """One moment on both clocks of this machine; `error_s`: uncertainty of reading them together."""

    monotonic_s: float
    calendar_s: float
    error_s: float

    @classmethod
    def now(cls) -> Self:
        """Read the clocks."""
        before_s = time.monotonic()
        calendar_s = time.time()
        after_s = time.monotonic()
        return cls(monotonic_s=(before_s + after_s) / 2, calendar_s=calendar_s, error_s=(after_s - before_s) / 2)


@final
@dataclass(frozen=True, kw_only=True)
class Dated:
    """Date of an image. `time_s`: monotonic, within `error_s` of the truth; `by`: its source."""

    time_s: float
    error_s: float
    by: Literal["calendar", "arrival"]


@final
@dataclass(frozen=True, kw_only=True)
class Dating:
    """Clock model of a camera: the least recent offset of monotonic time from its stamps [s].

    `period_s`: of its images. `former_s`: the least offset of the window before, so that the model always covers at
    least one whole window.
    """

    period_s: float
    offset_s: float = float("inf")
    former_s: float = float("inf")
    since_s: float = float("-inf")
    stamp_s: float = float("-inf")

    def date(self, stamp_s: float, domain: Domain, arrival: ClockReading) -> "tuple[Dated | None, Dating]":
        """Exposure time of an image stamped `stamp_s` that came at `arrival`, and the updated model.

        None where the stamp repeats that of the image before, to a tenth of a period: a frozen stream. An earlier stamp
        is of a restarted clock, whose model begins anew.
        """
        if abs(stamp_s - self.stamp_s) < _SAME * self.period_s:
            return None, self
        known = self if stamp_s > self.stamp_s else Dating(period_s=self.period_s)
        known = known._with(stamp_s, arrival)
        return known._calendar(stamp_s, domain, arrival) or known._by_arrival(stamp_s, arrival), known

    def _with(self, stamp_s: float, arrival: ClockReading) -> "Dating":
        offset_s, now_s = arrival.monotonic_s - stamp_s, arrival.monotonic_s
        if now_s - self.since_s > _FORGET_S:
            return replace(self, former_s=self.offset_s, offset_s=offset_s, since_s=now_s, stamp_s=stamp_s)
        return replace(self, offset_s=min(self.offset_s, offset_s), stamp_s=stamp_s)

    def _calendar(self, stamp_s: float, domain: Domain, arrival: ClockReading) -> Dated | None:
        """Date by the calendar; None where the stamp cannot be of the calendar."""
        age_s = arrival.calendar_s - stamp_s
        if domain == "hardware" or not -_FUTURE_S <= age_s <= _OLD_S:
            return None
        error_s = arrival.error_s + (GLOBAL_ERROR_S if domain == "global" else self.period_s)
        return Dated(time_s=arrival.monotonic_s - max(age_s, 0.0), error_s=max(error_s, -age_s), by="calendar")

    def _by_arrival(self, stamp_s: float, arrival: ClockReading) -> Dated:
        time_s = stamp_s + min(self.offset_s, self.former_s)
        return Dated(time_s=min(time_s, arrival.monotonic_s), error_s=self.period_s, by="arrival")
