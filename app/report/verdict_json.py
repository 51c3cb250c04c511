"""The verdict for programs, as `schema.VerdictFile`."""

import math
from pathlib import Path

import msgspec

from app.core.geometry.track import Track
from app.discovery.results.case import Case, CauseResult, Estimate, Formula, Gain, NextPush, Power
from app.report import schema
from app.report.drawing.size import size
from app.report.sections.advice import MODEL, advice
from app.report.sections.verdict import headline, probability


def verdict_json(case: Case, model: Path = MODEL) -> str:
    """The case as JSON of `schema.VerdictFile`, for a file. `model`: the saved model's file."""
    return msgspec.json.format(msgspec.json.encode(verdict_file(case, model)), indent=2).decode() + "\n"


def verdict_file(case: Case, model: Path = MODEL) -> schema.VerdictFile:
    """The case in the form of the file."""
    known = probability(case)
    return schema.VerdictFile(
        schema=1,
        verdict=case.verdict,
        headline=headline(case),
        probability=_finite_or_none(known[0]) if known is not None else None,
        probability_of=known[1] if known is not None else None,
        advice=advice(case, model),
        sentences=case.sentences,
        simulated=() if case.setup is None else case.setup.words,
        causes=tuple(map(_cause, case.causes)),
        formula=_formula(case.formula) if case.formula else None,
        leftover=_finite_or_none(case.leftover),
        heldout=_heldout(case.gain),
        next_push=_next_push(case.next_push) if case.next_push else None,
        limits=tuple(schema.LimitEntry(text=it.text, consequence=it.consequence, fatal=it.fatal) for it in case.limits),
        ranking=tuple(map(_cause, case.ranking)),
        power=tuple(map(_power, case.powers)),
        amount=msgspec.convert(case.amount, schema.AmountEntry, from_attributes=True),
        spent_s=tuple(
            schema.SpentEntry(stage=stage, seconds=_finite_or_none(seconds)) for stage, seconds in case.spent_s
        ),
    )


def _finite_or_none(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _cause(blame: CauseResult) -> schema.CauseEntry:
    whole = size(blame)
    return schema.CauseEntry(
        effect=blame.effect,
        family=blame.family,
        size=_finite_or_none(whole.value),
        unit=whole.unit,
        low=_finite_or_none(whole.low),
        high=_finite_or_none(whole.high),
        probability=_finite_or_none(blame.probability),
        log_bayes=_finite_or_none(blame.log_bayes),
        parameters=tuple(map(_parameter, blame.estimates)),
    )


def _parameter(estimate: Estimate) -> schema.ParameterEntry:
    return schema.ParameterEntry(
        name=estimate.name,
        value=_finite_or_none(estimate.value),
        unit=estimate.unit,
        low=_finite_or_none(estimate.low),
        high=_finite_or_none(estimate.high),
    )


def _formula(formula: Formula) -> schema.FormulaEntry:
    terms = tuple(
        schema.TermEntry(formula=term.formula, words=term.words, parameters=tuple(map(_parameter, term.estimates)))
        for term in formula.terms
    )
    return schema.FormulaEntry(text=formula.text, words=formula.words, terms=terms)


def _heldout(gain: Gain) -> schema.HeldoutEntry:
    return schema.HeldoutEntry(
        nominal=_finite_or_none(gain.nominal_mm),
        extended=_finite_or_none(gain.extended_mm),
        still=_finite_or_none(gain.still_mm),
        gain=_finite_or_none(gain.gain),
        low=_finite_or_none(gain.low),
        high=_finite_or_none(gain.high),
        episodes=gain.episodes,
    )


def track_entry(track: Track) -> schema.TrackEntry:
    """A path of the tool as numbers."""
    return schema.TrackEntry(times_s=tuple(track.times_s.tolist()), poses=tuple(map(tuple, track.poses.tolist())))


def _next_push(push: NextPush) -> schema.NextPushEntry:
    entry = track_entry(push.track)
    return schema.NextPushEntry(
        text=push.text, between=push.between, apart_mm=_finite_or_none(push.apart_mm), track=entry
    )


def _power(power: Power) -> schema.PowerEntry:
    return schema.PowerEntry(
        effect=power.effect,
        parameter=power.parameter,
        least=_finite_or_none(power.least),
        typical=_finite_or_none(power.typical),
        unit=power.unit,
    )
