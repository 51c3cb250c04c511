"""The table of targets of docs/discovery.md: each a quantity of many outcomes, its aim, and if that is met.

"First" is what a verdict puts first: a cause, nothing, or that it is none of these.
"""

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from typing import Literal, TypeAlias, final

from app.evaluation.intervals import Measured, median, share
from bench.hidden.curves import calibration_error, reliability
from bench.hidden.draws import WORLDS, World
from bench.hidden.outcome import ACTUATION, NUMERICS, SENSING, Blamed, Outcome, Truth, away

CONFIDENT = 0.8
"""Probability from which a name is one with confidence."""
FULL = 1.0
"""Size in typical ones from which a cause ought to be found."""
_WORTH = 0.05
"""Share of the nominal model's error that an oracle must take away, for shares of its gain to mean anything."""

Score: TypeAlias = Callable[[Sequence[Outcome]], Measured]
Limit: TypeAlias = tuple[Literal["<=", ">=", "in"], float, float]
"""Comparison of a value: with the first number, or between both."""


@final
@dataclass(frozen=True, kw_only=True)
class Target:
    """A row of the table; `limits` for the own engine and for the other one, None where there is no aim."""

    name: str
    score: Score
    limits: tuple[Limit | None, Limit | None]
    scale: Literal["share", "ratio", "seconds", "megabytes"] = "share"


@final
@dataclass(frozen=True, kw_only=True)
class Row:
    """A target in one world; `met` is None where there is no aim or no case."""

    target: Target
    world: World
    limit: Limit | None
    measured: Measured
    met: bool | None


def rows(outcomes: Sequence[Outcome]) -> list[Row]:
    """Rows of every target in every world."""
    return [
        _row(target, world, limit, [outcome for outcome in outcomes if outcome.world == world])
        for target in TARGETS
        for world, limit in zip(WORLDS, target.limits, strict=True)
    ]


def passes(outcomes: Sequence[Outcome]) -> bool:
    """True if every aim is met for which there are cases."""
    return all(row.met is not False for row in rows(outcomes))


def alarming(outcome: Outcome) -> bool:
    """True if a verdict says that something is missing; numerics do not count, which own recordings do have."""
    if outcome.verdict == "none_of_these":
        return True
    return any(cause.category != NUMERICS for cause in outcome.causes)


def found(outcome: Outcome, truth: Truth) -> Blamed | None:
    """Verdict's entry of a hidden cause, if it is first or one of several that act."""
    return next((cause for cause in outcome.causes if cause.effect == truth.effect), None)


def size_error(outcome: Outcome) -> float:
    """The relative error of the size, of a cause that was first."""
    truth = outcome.single
    assert truth is not None
    blamed = found(outcome, truth)
    real = abs(truth.size - truth.null)
    return float("nan") if blamed is None else abs(away(truth, blamed.size) - real) / real


def covered(truth: Truth, blamed: Blamed) -> bool:
    """True if the interval holds the true size, whatever its sign if that has no meaning."""
    ends = sorted((away(truth, blamed.low), away(truth, blamed.high)))
    if blamed.low <= truth.null <= blamed.high:
        ends[0] = min(ends[0], 0.0)
    return ends[0] <= abs(truth.size - truth.null) <= ends[1]


def _row(target: Target, world: World, limit: Limit | None, outcomes: Sequence[Outcome]) -> Row:
    measured = target.score(outcomes)
    met = None if limit is None or measured.n == 0 else _within(measured.value, limit)
    return Row(target=target, world=world, limit=limit, measured=measured, met=met)


def _within(value: float, limit: Limit) -> bool:
    kind, first, second = limit
    if kind == "in":
        return first <= value <= second
    return value <= first if kind == "<=" else value >= first


def _controls(outcomes: Sequence[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if not outcome.truths]


def _full(outcomes: Sequence[Outcome]) -> list[tuple[Outcome, Truth]]:
    """Cases with one effect of the catalogue of at least its typical size."""
    singles = ((outcome, outcome.single) for outcome in outcomes)
    return [(outcome, truth) for outcome, truth in singles if truth is not None and truth.typical >= FULL]


def _apparatus(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Cases with one error of cameras or arm."""
    return [outcome for outcome in outcomes if _is_of(outcome, (SENSING, ACTUATION))]


def _physics(outcomes: Sequence[Outcome]) -> list[Outcome]:
    """Cases with one effect of physics."""
    return [outcome for outcome in outcomes if outcome.single and not _is_of(outcome, (SENSING, ACTUATION))]


def _is_of(outcome: Outcome, categories: Sequence[str]) -> bool:
    return outcome.single is not None and outcome.single.category in categories


def _of(part: Callable[[Sequence[Outcome]], list[Outcome]], score: Score) -> Score:
    """A score of a part of all cases."""
    return lambda outcomes: score(part(outcomes))


def _two(outcomes: Sequence[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if len(outcome.truths) == 2 and not outcome.outside]


def _strangers(outcomes: Sequence[Outcome]) -> list[Outcome]:
    return [outcome for outcome in outcomes if outcome.outside]


def _alarms(outcomes: Sequence[Outcome]) -> Measured:
    return share(alarming(outcome) for outcome in _controls(outcomes))


def _confident_alarms(outcomes: Sequence[Outcome]) -> Measured:
    return share(
        any(cause.probability > CONFIDENT and cause.category != NUMERICS for cause in outcome.causes)
        for outcome in _controls(outcomes)
    )


def _wrongly_sure(outcomes: Sequence[Outcome]) -> Measured:
    """Share of all cases in which a cause that was not hidden is named with confidence."""
    return share(
        outcome.verdict == "named"
        and any(
            cause.probability > CONFIDENT and cause.category != NUMERICS and cause.effect not in outcome.hidden
            for cause in outcome.causes
        )
        for outcome in outcomes
    )


def _calibration(outcomes: Sequence[Outcome]) -> Measured:
    stated = [outcome for outcome in outcomes if outcome.ranking]
    return Measured(calibration_error(reliability(stated)), math.nan, math.nan, len(stated))


def _top(outcomes: Sequence[Outcome]) -> Measured:
    return share(outcome.first == truth.effect for outcome, truth in _full(outcomes))


def _class(outcomes: Sequence[Outcome]) -> Measured:
    return share(_first_category(outcome) == truth.category for outcome, truth in _full(outcomes))


def _first_category(outcome: Outcome) -> str:
    causes = [*outcome.causes, *outcome.ranking]
    return next((cause.category for cause in causes if cause.effect == outcome.first), outcome.first)


def _three(outcomes: Sequence[Outcome]) -> Measured:
    return share(truth.effect in [each.effect for each in outcome.ranking[:3]] for outcome, truth in _full(outcomes))


def _named(outcomes: Sequence[Outcome]) -> Measured:
    return share(outcome.named == (truth.effect,) for outcome, truth in _full(outcomes))


def _sizes(outcomes: Sequence[Outcome]) -> Measured:
    return median(size_error(outcome) for outcome in outcomes if outcome.single is not None)


def _intervals(outcomes: Sequence[Outcome]) -> Measured:
    pairs = [(truth, found(outcome, truth)) for outcome in outcomes if (truth := outcome.single) is not None]
    return share(covered(truth, blamed) for truth, blamed in pairs if blamed is not None)


def _sets(outcomes: Sequence[Outcome]) -> Measured:
    return share(
        any(cause.effect == truth.effect for cause in outcome.causes)
        for outcome in outcomes
        if (truth := outcome.single) is not None and outcome.verdict in ("named", "set")
    )


def _gains(outcomes: Sequence[Outcome]) -> Measured:
    return median(
        (1 - outcome.extended_mm / outcome.nominal_mm) / (1 - outcome.oracle_mm / outcome.oracle_nominal_mm)
        for outcome in outcomes
        if not outcome.outside and outcome.oracle_mm < (1 - _WORTH) * outcome.oracle_nominal_mm
    )


def _both(outcomes: Sequence[Outcome]) -> Measured:
    return share(outcome.hidden <= set(outcome.named) for outcome in _two(outcomes))


def _one_of_two(outcomes: Sequence[Outcome]) -> Measured:
    return share(bool(outcome.hidden & {cause.effect for cause in outcome.causes}) for outcome in _two(outcomes))


def _third(outcomes: Sequence[Outcome]) -> Measured:
    return share(len(outcome.named) > 2 and not set(outcome.named) <= outcome.hidden for outcome in _two(outcomes))


def _says_so(outcomes: Sequence[Outcome]) -> Measured:
    return share(outcome.verdict == "none_of_these" for outcome in _strangers(outcomes))


def _falsely_sure(outcomes: Sequence[Outcome]) -> Measured:
    return share(
        any(cause.probability > CONFIDENT for cause in outcome.causes) and outcome.verdict == "named"
        for outcome in _strangers(outcomes)
    )


def _worse(outcomes: Sequence[Outcome]) -> Measured:
    return share(outcome.extended_mm > outcome.nominal_mm for outcome in outcomes)


def _screening(outcomes: Sequence[Outcome]) -> Measured:
    return median(outcome.screening_s for outcome in outcomes)


def _whole(outcomes: Sequence[Outcome]) -> Measured:
    return median(outcome.whole_s for outcome in outcomes)


def _memory(outcomes: Sequence[Outcome]) -> Measured:
    return median(outcome.peak_mb for outcome in outcomes)


FIRST, CLASS, THREE = "first is right, at >= 1x typical", "its class is right", "among the first three"
SIZE, COVERED = "size, median relative error", "size within its 90 % interval"
GAIN, WORSE = "share of the oracle's held-out gain, median", "saved model worse than nominal, held out"
ALARMS, SURE_ALARMS = "says that something is missing, of none", "names with confidence > 0.8, of none"
SURE_WRONG = "wrong with confidence > 0.8, of all"
NAMED = "named alone"
_PHYSICS, _APPARATUS = "physics: ", "cameras and arm: "

TARGETS = (
    Target(name=ALARMS, score=_alarms, limits=(("<=", 0.05, 0), ("<=", 0.08, 0))),
    Target(name=SURE_ALARMS, score=_confident_alarms, limits=(("<=", 0.02, 0), ("<=", 0.05, 0))),
    Target(name=SURE_WRONG, score=_wrongly_sure, limits=(("<=", 0.05, 0), ("<=", 0.08, 0))),
    Target(name=_PHYSICS + FIRST, score=_of(_physics, _top), limits=((">=", 0.85, 0), (">=", 0.75, 0))),
    Target(name=_PHYSICS + CLASS, score=_of(_physics, _class), limits=((">=", 0.95, 0), (">=", 0.88, 0))),
    Target(name=_PHYSICS + THREE, score=_of(_physics, _three), limits=((">=", 0.97, 0), (">=", 0.92, 0))),
    Target(name=_APPARATUS + FIRST, score=_of(_apparatus, _top), limits=((">=", 0.95, 0), (">=", 0.95, 0))),
    Target(name=_APPARATUS + CLASS, score=_of(_apparatus, _class), limits=((">=", 0.98, 0), (">=", 0.98, 0))),
    Target(name=_APPARATUS + THREE, score=_of(_apparatus, _three), limits=((">=", 0.99, 0), (">=", 0.99, 0))),
    Target(name=NAMED, score=_named, limits=(None, None)),
    Target(name=SIZE, score=_sizes, limits=(("<=", 0.15, 0), ("<=", 0.25, 0)), scale="ratio"),
    Target(name=COVERED, score=_intervals, limits=(("in", 0.85, 0.95), ("in", 0.80, 0.95))),
    Target(name="expected calibration error", score=_calibration, limits=(("<=", 0.05, 0), ("<=", 0.08, 0))),
    Target(name="cause among those of the verdict", score=_sets, limits=((">=", 0.88, 0), (">=", 0.80, 0))),
    Target(name=GAIN, score=_gains, limits=((">=", 0.90, 0), (">=", 0.80, 0)), scale="ratio"),
    Target(name="two effects: both named", score=_both, limits=((">=", 0.60, 0), (">=", 0.50, 0))),
    Target(name="two effects: at least one", score=_one_of_two, limits=((">=", 0.95, 0), (">=", 0.90, 0))),
    Target(name="two effects: a spurious third", score=_third, limits=(("<=", 0.10, 0), ("<=", 0.10, 0))),
    Target(name="outside the catalogue: says so", score=_says_so, limits=((">=", 0.80, 0), (">=", 0.75, 0))),
    Target(name="outside the catalogue: a wrong name, > 0.8", score=_falsely_sure, limits=(("<=", 0.05, 0), None)),
    Target(name=WORSE, score=_worse, limits=(("<=", 0.02, 0), ("<=", 0.04, 0))),
    Target(name="screening verdict, median", score=_screening, limits=(None, None), scale="seconds"),
    Target(name="whole chain, median", score=_whole, limits=(None, None), scale="seconds"),
    Target(name="peak memory, median", score=_memory, limits=(None, None), scale="megabytes"),
)
"""Aims of docs/discovery.md, and of its background those of sets and of wrong names.

Times have aims for 10 episodes of 20 pushes alone: a verdict after screening within 60 s, the whole within 5 min, on
two cores.
"""

IN_FAMILY: Mapping[str, Score] = {
    NAMED: _named,
    FIRST: _top,
    CLASS: _class,
    THREE: _three,
    SIZE: _sizes,
    COVERED: _intervals,
    GAIN: _gains,
    WORSE: _worse,
}
"""Scores that are reported for each family of causes."""
IN_BASELINES: Mapping[str, Score] = {
    ALARMS: _alarms,
    SURE_ALARMS: _confident_alarms,
    SURE_WRONG: _wrongly_sure,
    FIRST: _top,
    CLASS: _class,
    THREE: _three,
    SIZE: _sizes,
}
"""Scores that other methods have, too."""


def of_family(outcomes: Sequence[Outcome], category: str) -> list[Outcome]:
    """Cases with one effect of this family."""
    return [outcome for outcome in outcomes if _is_of(outcome, (category,))]
