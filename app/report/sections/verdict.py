"""The verdict in one line, above the case's own sentences."""

import math

from app.core.dialogue import words
from app.core.dialogue.words import sentence
from app.discovery.results.case import Case, Gain
from app.report.drawing.words import decimal, gain_and_interval, names
from app.sim.effects.base import LIQUIDS

_KINDS = {
    "named": "A cause is named",
    "set": "Several causes are left",
    "none": "No cause is found",
    "none_of_these": "None of the known causes",
}


_LIKELIER = 0.5
"""Probability above which a missing cause is more likely than none."""
_SURELY = 0.9
"""Probability above which a cause is reported missing. Of the recordings that confidence was learnt from, seven in
ten had something hidden in them: a probability of about that says nothing."""


def kind(case: Case) -> str:
    """Kind of verdict, in plain words."""
    if case.verdict == "named" and len(case.causes) > 1:
        return "Causes that act together"
    if case.verdict == "none" and is_missing_something(case):
        return "No cause is sure enough"
    return _KINDS[case.verdict]


def headline(case: Case) -> str:
    """The verdict in a few words."""
    effects = tuple(blame.effect for blame in case.causes)
    if any(limit.fatal for limit in case.limits):
        return "These data cannot name a cause"
    if case.verdict == "named":
        return sentence(names(effects, "and"))
    if case.verdict == "set":
        return sentence(names(effects, "or"))
    if case.verdict == "none":
        if _missing(case) > _SURELY:
            return "Something is missing, and these data cannot tell what"
        if is_missing_something(case):
            return "Perhaps something is missing; these data cannot tell"
        return "The model lacks nothing that these data would show"
    return "Something acts that no known cause explains"


def chance(case: Case) -> tuple[str, str] | None:
    """Probability of the verdict, and the statement that it is for; None where unknown."""
    known = probability(case)
    return None if known is None else (words.probability(known[0]), known[1])


def probability(case: Case) -> tuple[float, str] | None:
    """The probability as a number, 0 to 1, with its statement."""
    chances = [blame.probability for blame in case.causes]
    if case.verdict == "named" and chances:
        return min(chances), "that this is missing" if len(chances) == 1 else "for the least certain of them"
    if case.verdict == "set" and chances:
        return min(sum(chances), 1.0), "that it is one of these"
    if case.verdict == "none" and is_missing_something(case):
        return _missing(case), "that something is missing"
    if not math.isfinite(case.leftover):
        return None
    if case.verdict == "none":
        return min(1 - case.leftover, 1 - _missing(case)), "that nothing is missing"
    return case.leftover, "that something else acts"


def is_missing_something(case: Case) -> bool:
    """True where it is more likely that some cause acts than that none does."""
    return _missing(case) > _LIKELIER


def _missing(case: Case) -> float:
    """The probability of any cause at all."""
    return min(sum(blame.probability for blame in case.ranking), 1.0)


def is_extended(gain: Gain) -> bool:
    """True where there is an extended model, which predicts otherwise than the refitted nominal one."""
    return gain.extended_mm != gain.nominal_mm


def unit_of(case: Case) -> str:
    """Unit of the errors: of what is poured they are hundredths of it."""
    return "% of the liquid" if case.kind in LIQUIDS else "mm"


def gain_sentence(gain: Gain, unit: str = "mm") -> str:
    """The gain in a sentence, or a note that it could not be measured."""
    if gain.nominal_mm == 0 and gain.episodes > 0:
        return (
            f"Nothing can be gained: the refitted model errs by nothing on {gain.episodes} held-out episodes, one in "
            f"which nothing moves by {decimal(gain.still_mm, 1)} {unit}."
        )
    if not math.isfinite(gain.gain) or gain.episodes == 0:
        return "What an extended model would gain was not measured: there are no held-out episodes to measure it on."
    if not is_extended(gain):
        return (
            f"No extended model is used: the refitted one errs by {decimal(gain.nominal_mm, 1)} {unit} on "
            f"{gain.episodes} held-out episodes, one in which nothing moves by {decimal(gain.still_mm, 1)} {unit}."
        )
    errors = f"{decimal(gain.nominal_mm, 1)} to {decimal(gain.extended_mm, 1)} {unit}"
    share = gain_and_interval(gain.gain, gain.low, gain.high)
    return (
        f"{share} of the one-step error is gone: {errors} on {gain.episodes} held-out episodes; a model in which "
        f"nothing moves errs by {decimal(gain.still_mm, 1)} {unit}."
    )
