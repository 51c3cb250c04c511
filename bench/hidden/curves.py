"""Diagnostics beside the table of targets: confusions, reliability of stated probabilities, and power by size."""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise
from typing import final

import numpy as np
from jaxtyping import Int64

from app.evaluation.intervals import Measured, share
from bench.hidden.outcome import CLASSES, NOTHING, OUTSIDE, Outcome, Truth

BINS = 10
SIZES = (0.25, 0.5, 0.75, 1.0, 1.5, 2.0)
"""Edges, in typical sizes, between which power is counted."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Confusion:
    """Counts of `names[i]`, hidden, that was taken for `names[j]`; cases with one thing hidden, or nothing."""

    names: tuple[str, ...]
    counts: Int64[np.ndarray, "C C"]


@final
@dataclass(frozen=True, kw_only=True)
class Bin:
    """Verdicts that state a probability between `low` and `high`: its mean, and how many of them are right."""

    low: float
    high: float
    stated: float
    right: Measured


@final
@dataclass(frozen=True, kw_only=True)
class Power:
    """Power for causes of a class, hidden at sizes between two edges: the share that is named alone, and first."""

    category: str
    low: float
    high: float
    named: Measured
    first: Measured


def confusion(outcomes: Sequence[Outcome]) -> Confusion:
    """Confusion by effect, in alphabetical order; nothing, and effects outside the catalogue, last."""
    pairs = Counter((_hidden(each), each.first) for each in outcomes if len(each.truths) < 2)
    last = [name for name in CLASSES if any(name in pair for pair in pairs)]
    names = tuple(sorted({name for pair in pairs for name in pair} - set(last))) + tuple(last)
    counts = np.array([[pairs[row, column] for column in names] for row in names], np.int64)
    return Confusion(names=names, counts=counts.reshape(len(names), len(names)))


def confusion_of_classes(outcomes: Sequence[Outcome]) -> Confusion:
    """Confusion by class."""
    pairs = Counter((_class(each), _blamed_class(each)) for each in outcomes if len(each.truths) < 2)
    counts = np.array([[pairs[row, column] for column in CLASSES] for row in CLASSES], np.int64)
    return Confusion(names=CLASSES, counts=counts)


def reliability(outcomes: Sequence[Outcome]) -> list[Bin]:
    """Reliability of the probability of the likeliest cause; if several act, of the least likely of these."""
    stated = [(_stated(each), _likeliest_is_hidden(each)) for each in outcomes if each.ranking]
    bins = list[Bin]()
    for number in range(BINS):
        low, high = number / BINS, (number + 1) / BINS
        inside = [pair for pair in stated if low <= pair[0] < high or (number == BINS - 1 and pair[0] == 1.0)]
        mean = float(np.mean([probability for probability, _ in inside])) if inside else float("nan")
        bins.append(Bin(low=low, high=high, stated=mean, right=share(hit for _, hit in inside)))
    return bins


def calibration_error(bins: Sequence[Bin]) -> float:
    """Expected calibration error: the mean distance of stated probabilities from shares of right ones, over cases."""
    filled = [each for each in bins if each.right.n]
    total = sum(each.right.n for each in filled)
    return sum(each.right.n * abs(each.stated - each.right.value) for each in filled) / total if total else float("nan")


def power(outcomes: Sequence[Outcome]) -> list[Power]:
    """Power by class and size, of cases with one effect of the catalogue; only where there are any."""
    singles = [(outcome, truth) for outcome in outcomes if (truth := outcome.single) is not None]
    powers = list[Power]()
    for category in dict.fromkeys(truth.category for _, truth in singles):
        own = [(outcome, truth) for outcome, truth in singles if truth.category == category]
        for low, high in pairwise(SIZES):
            last = high == SIZES[-1]
            inside = [pair for pair in own if low <= pair[1].typical < high or (last and pair[1].typical == high)]
            if inside:
                powers.append(_power(category, low, high, inside))
    return powers


def _power(category: str, low: float, high: float, inside: Sequence[tuple[Outcome, Truth]]) -> Power:
    return Power(
        category=category,
        low=low,
        high=high,
        named=share(outcome.named == (truth.effect,) for outcome, truth in inside),
        first=share(outcome.first == truth.effect for outcome, truth in inside),
    )


def _hidden(outcome: Outcome) -> str:
    if outcome.outside:
        return OUTSIDE
    return outcome.truths[0].effect if outcome.truths else NOTHING


def _class(outcome: Outcome) -> str:
    return outcome.truths[0].category if outcome.truths else NOTHING


def _blamed_class(outcome: Outcome) -> str:
    causes = [*outcome.causes, *outcome.ranking]
    return next((cause.category for cause in causes if cause.effect == outcome.first), outcome.first)


def _stated(outcome: Outcome) -> float:
    if len(outcome.named) > 1:
        return min(cause.probability for cause in outcome.causes)
    return outcome.ranking[0].probability


def _likeliest_is_hidden(outcome: Outcome) -> bool:
    if len(outcome.named) > 1:
        return set(outcome.named) <= outcome.hidden
    return outcome.ranking[0].effect in outcome.hidden
