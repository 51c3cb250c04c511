"""Shares, means and medians with 95 % intervals, of few cases."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.stats import binom, bootstrap

_Z = 1.96
"""Of a 95 % interval."""
_SAME = 1e-9
"""Numbers that differ by less than this share of their mean are the same number, rounded."""


class Measured(NamedTuple):
    """A share or a median of `n` cases with its 95 % interval; NaN where there is no case."""

    value: float
    low: float
    high: float
    n: int


def share(events: Iterable[bool]) -> Measured:
    """The share of what is true, with Wilson's interval (1927, "Probable inference, the law of succession")."""
    known = list(events)
    n = len(known)
    if n == 0:
        return Measured(math.nan, math.nan, math.nan, 0)
    p = sum(known) / n
    middle = (p + _Z**2 / (2 * n)) / (1 + _Z**2 / n)
    half = _Z / (1 + _Z**2 / n) * math.sqrt(p * (1 - p) / n + _Z**2 / (4 * n**2))
    return Measured(p, max(0.0, middle - half), min(1.0, middle + half), n)


def median(values: Iterable[float]) -> Measured:
    """The median of what is finite, with the interval of order statistics that a binomial law gives."""
    known = np.sort([value for value in values if math.isfinite(value)])
    n = len(known)
    if n == 0:
        return Measured(math.nan, math.nan, math.nan, 0)
    below = int(binom.ppf(0.025, n, 0.5))
    return Measured(float(np.median(known)), float(known[max(below - 1, 0)]), float(known[min(n - below, n - 1)]), n)


def mean(values: Iterable[float]) -> Measured:
    """The mean of what is finite, with the bootstrap's interval (Efron 1987, "Better bootstrap confidence intervals").

    No law of the values is assumed, only that there are enough of them.
    """
    known = np.array([value for value in values if math.isfinite(value)])
    n = len(known)
    if n == 0:
        return Measured(math.nan, math.nan, math.nan, 0)
    middle = float(known.mean())
    if n == 1 or np.ptp(known) <= _SAME * abs(middle):
        return Measured(middle, middle if n > 1 else math.nan, middle if n > 1 else math.nan, n)
    found = bootstrap((known,), np.mean, rng=np.random.default_rng(0), method="BCa").confidence_interval
    return Measured(middle, float(found.low), float(found.high), n)
