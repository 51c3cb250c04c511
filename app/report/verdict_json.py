"""The verdict for programs, as `schema.VerdictFile`."""

import math

import msgspec

from app.core.geometry.track import Track
from app.discovery.results.case import Case, CauseResult, Estimate, Formula, Gain, NextPush, Power
from app.report import schema
from app.report.drawing.size import size
from app.report.sections.advice import advice
from app.report.sections.verdict import headline, probability


def verdict_json(case: Case) -> str:
    """The case as JSON of `schema.VerdictFile`, for a file."""
    return msgspec.json.format(msgspec.json.encode(verdict_file(case)), indent=2).decode() + "\n"


def verdict_file(case: Case) -> schema.VerdictFile:
    """The case in the form of the file."""
    known = probability(case)
    return schema.VerdictFile(
        schema=1,
        verdict=case.verdict,
        headline=headline(case),
        probability=_known(known[0]) if known is not None else None,
        probability_of=known[1] if known is not None else None,
        advice=advice(case),
        sentences=case.sentences,
        simulated=() if case.setup is None else case.setup.words,
        causes=tuple(map(_cause, case.causes)),
        formula=_formula(case.formula) if case.formula else None,
        leftover=_known(case.leftover),
        heldout=_heldout(case.gain),
        next_push=_next_push(case.next_push) if case.next_push else None,
        limits=tuple(schema.LimitEntry(text=it.text, consequence=it.consequence, fatal=it.fatal) for it in case.limits),
        ranking=tuple(map(_cause, case.ranking)),
        power=tuple(map(_power, case.powers)),
        amount=msgspec.convert(case.amount, schema.AmountEntry, from_attributes=True),
        spent_s=tuple(schema.SpentEntry(stage=stage, seconds=_known(seconds)) for stage, seconds in case.spent_s),
    )


def _known(value: float) -> float | None:
    return float(value) if math.isfinite(value) else None


def _cause(blame: CauseResult) -> schema.CauseEntry:
    whole = size(blame)
    return schema.CauseEntry(
        effect=blame.effect,
        family=blame.family,
        size=_known(whole.value),
        unit=whole.unit,
        low=_known(whole.low),
        high=_known(whole.high),
        probability=_known(blame.probability),
        log_bayes=_known(blame.log_bayes),
        parameters=tuple(map(_parameter, blame.estimates)),
    )


def _parameter(estimate: Estimate) -> schema.ParameterEntry:
    return schema.ParameterEntry(
        name=estimate.name,
        value=_known(estimate.value),
        unit=estimate.unit,
        low=_known(estimate.low),
        high=_known(estimate.high),
    )


def _formula(formula: Formula) -> schema.FormulaEntry:
    terms = tuple(
        schema.TermEntry(formula=term.formula, words=term.words, parameters=tuple(map(_parameter, term.estimates)))
        for term in formula.terms
    )
    return schema.FormulaEntry(text=formula.text, words=formula.words, terms=terms)


def _heldout(gain: Gain) -> schema.HeldoutEntry:
    return schema.HeldoutEntry(
        nominal=_known(gain.nominal_mm),
        extended=_known(gain.extended_mm),
        still=_known(gain.still_mm),
        gain=_known(gain.gain),
        low=_known(gain.low),
        high=_known(gain.high),
        episodes=gain.episodes,
    )


def track_entry(track: Track) -> schema.TrackEntry:
    """A path of the tool as numbers."""
    return schema.TrackEntry(times_s=tuple(track.times_s.tolist()), poses=tuple(map(tuple, track.poses.tolist())))


def _next_push(push: NextPush) -> schema.NextPushEntry:
    entry = track_entry(push.track)
    return schema.NextPushEntry(text=push.text, between=push.between, apart_mm=_known(push.apart_mm), track=entry)


def _power(power: Power) -> schema.PowerEntry:
    return schema.PowerEntry(
        effect=power.effect,
        parameter=power.parameter,
        least=_known(power.least),
        typical=_known(power.typical),
        unit=power.unit,
    )
