"""Shares, means and medians with 95 % intervals, of few cases."""

import math
from collections.abc import Iterable
from typing import NamedTuple

import numpy as np
from scipy.stats import binom, binomtest, t

_FEWEST = 4
"""Fewer values say next to nothing about their spread."""


class Measured(NamedTuple):
    """A share, mean or median of `n` cases with its 95 % interval; NaN where there are too few for one."""

    value: float
    low: float
    high: float
    n: int


def share(events: Iterable[bool]) -> Measured:
    """The share of true values, with Wilson's interval (1927, "Probable inference, the law of succession")."""
    known = list(events)
    n = len(known)
    if n == 0:
        return Measured(math.nan, math.nan, math.nan, 0)
    interval = binomtest(sum(known), n).proportion_ci(method="wilson")
    return Measured(sum(known) / n, float(interval.low), float(interval.high), n)


def median(values: Iterable[float]) -> Measured:
    """The median of the finite values, with the interval of order statistics that a binomial law gives."""
    known = np.sort([value for value in values if math.isfinite(value)])
    n = len(known)
    if n == 0:
        return Measured(math.nan, math.nan, math.nan, 0)
    below = int(binom.ppf(0.025, n, 0.5))
    return Measured(float(np.median(known)), float(known[max(below - 1, 0)]), float(known[min(n - below, n - 1)]), n)


def mean(values: Iterable[float]) -> Measured:
    """The mean of the finite values, with Student's interval (1908, "The probable error of a mean"), of four or more.

    Of ten values a bootstrap's interval covers the mean in nine cases of ten, of three in three of four.
    """
    known = np.array([value for value in values if math.isfinite(value)])
    n = len(known)
    if n == 0:
        return Measured(math.nan, math.nan, math.nan, 0)
    middle = float(known.mean())
    if n < _FEWEST:
        return Measured(middle, math.nan, math.nan, n)
    half = float(t.ppf(0.975, n - 1) * known.std(ddof=1)) / math.sqrt(n)
    return Measured(middle, middle - half, middle + half, n)
