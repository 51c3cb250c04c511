"""Verdict from a decision, in words and numbers: names, sizes in real units, and undetectable sizes."""

from collections.abc import Mapping, Sequence

import numpy as np

from app.core.dialogue import words
from app.core.dialogue.model_monitor_messages import VerdictKind
from app.discovery.dataset.model_under_test import Catalogue, Subject, Theta
from app.discovery.dataset.names import effect_name
from app.discovery.inference.decide import NAMED, TEMPERATURE, ModelSelection
from app.discovery.inference.refine import RefinedModel
from app.discovery.inference.screen import Screening
from app.discovery.inference.weighing import Z90, project_out
from app.discovery.results.case import CauseResult, Estimate, Formula, Limit, Power
from app.discovery.unexplained.formula import UnexplainedForce
from app.discovery.unexplained.residual_test import LEFT

_SET = 0.9
"""Probability that a set of causes has, where none is named."""
_LIKELIER = 0.5
"""Probability above which a cause that is not accepted is likelier than anything else."""
_SMALL = 0.2
"""Metres or seconds below which a sentence counts in thousandths."""
_BESIDE = 0.5
"""Share of the likeliest cause's probability from which another is named beside it."""
_LISTED = 4
"""Causes of a set that a sentence lists."""
_NAMEABLE = 4.0 * TEMPERATURE
"""Evidence of the screening from which a cause is named alone, in a catalogue of this size."""


def verdict_of(
    decision: ModelSelection, limits: Sequence[Limit], opened: UnexplainedForce
) -> tuple[VerdictKind, tuple[str, ...]]:
    """The kind of verdict, and the causes that it is about."""
    if any(limit.fatal for limit in limits):
        return "none", ()
    if opened.found is not None or decision.unknown > NAMED:
        return "none_of_these", ()
    if decision.accepted is None:
        return "none_of_these" if opened.left.probability > LEFT else "none", ()
    if len(decision.accepted.causes) > 1:
        return "named", decision.accepted.causes
    ranked = sorted(decision.probabilities.items(), key=lambda pair: -pair[1])
    if ranked[0][1] > NAMED:
        return "named", (ranked[0][0],)
    chosen, mass = list[str](), decision.nothing + decision.unknown
    for name, probability in ranked:
        chosen.append(name)
        mass += probability
        if mass > _SET:
            break
    return "set", tuple(chosen)


def ranking_of(
    catalogue: Catalogue, subject: Subject, screening: Screening, decision: ModelSelection
) -> tuple[CauseResult, ...]:
    """Causes that were weighed, the most probable first; with refitted sizes if there are some."""
    models = {model.causes[0]: model for model in decision.singles}
    blames = list[CauseResult]()
    for suspect in screening.suspects:
        cause, model = catalogue.cause(suspect.cause), models.get(suspect.cause)
        if model is not None:
            estimates = estimates_of(catalogue, subject, model, suspect.cause)
            log_bayes = model.log_evidence - screening.weighing.log_evidence
        else:
            sizes = np.array([step.size for step in suspect.steps])
            shifts = suspect.finding.mean * sizes
            spread = np.sqrt(np.diag(suspect.finding.covariance)) * np.abs(sizes)
            estimates = tuple(
                estimate_of(catalogue, subject, step.column, screening.about, float(shift), float(deviation))
                for step, shift, deviation in zip(suspect.steps, shifts, spread, strict=True)
            )
            log_bayes = suspect.finding.log_bayes
        blames.append(
            CauseResult(
                effect=cause.name,
                family=cause.family,
                about=cause.about,
                estimates=estimates,
                probability=decision.probabilities[cause.name],
                log_bayes=float(log_bayes),
            )
        )
    return tuple(sorted(blames, key=lambda blame: -blame.probability))


def estimates_of(
    catalogue: Catalogue, subject: Subject, model: RefinedModel, cause: str | None
) -> tuple[Estimate, ...]:
    """The parameters of a cause that the model has; of the calibrated ones where `cause` is None."""
    deviations = np.sqrt(np.diag(model.covariance))
    names = {one.name for one in catalogue.causes}
    return tuple(
        estimate_of(catalogue, subject, step.column, model.estimate, 0.0, float(sd) * step.size)
        for step, sd in zip(model.steps[: model.own], deviations, strict=True)
        if (step.cause == cause if cause is not None else step.cause not in names)
    )


def estimate_of(
    catalogue: Catalogue, subject: Subject, column: int, about: Theta, shift: float, deviation: float
) -> Estimate:
    """A parameter in real units: where `about` has it, moved by `shift`, give or take `deviation` (coordinates)."""
    spec = catalogue.specs[column]
    here = spec.coordinate(float(about[column])) + shift

    def real(coordinate: float) -> float:
        return spec.real(spec.value(coordinate), subject.time_scale, subject.gravity_scale) + catalogue.told_m(column)

    return Estimate(
        name=spec.name,
        about=spec.about,
        value=real(here),
        unit=spec.unit,
        low=real(here - Z90 * deviation),
        high=real(here + Z90 * deviation),
        null=spec.real(spec.nominal, subject.time_scale, subject.gravity_scale) + catalogue.told_m(column),
    )


def powers_of(catalogue: Catalogue, subject: Subject, screening: Screening) -> tuple[Power, ...]:
    """Smallest size of each switch whose expected evidence, everything else being free, is enough for a name."""
    A = screening.weighing.nothing.forms.A.sum(0) / screening.weighing.temperature
    powers = list[Power]()
    for suspect in screening.suspects:
        for column, step in zip(suspect.columns, suspect.steps, strict=True):
            spec = catalogue.specs[step.column]
            information = float(project_out(A, screening.prior, [column])[2][0, 0])
            needed = np.sqrt(2 * _NAMEABLE / information) if information > 0 else np.inf
            null, typical = spec.nominal, spec.typical
            assert typical is not None
            least = spec.coordinate(null) + needed * step.size
            low, high = spec.coordinate(spec.low), spec.coordinate(spec.high)
            visible = low <= least <= high
            powers.append(
                Power(
                    effect=suspect.cause,
                    parameter=spec.name,
                    least=_size(catalogue, subject, step.column, spec.value(least)) if visible else float("inf"),
                    typical=_size(catalogue, subject, step.column, typical),
                    unit=spec.unit,
                )
            )
    return tuple(powers)


def _size(catalogue: Catalogue, subject: Subject, column: int, value: float) -> float:
    spec = catalogue.specs[column]
    return abs(
        spec.real(value, subject.time_scale, subject.gravity_scale)
        - spec.real(spec.nominal, subject.time_scale, subject.gravity_scale)
    )


def sentences_of(
    verdict: VerdictKind,
    causes: Sequence[CauseResult],
    gain_text: str,
    limits: Sequence[Limit],
    probabilities: Mapping[str, float],
    left: float,
    formula: Formula | None,
) -> tuple[str, ...]:
    """Two or three sentences that stand for themselves."""
    if any(limit.fatal for limit in limits):
        return ("These recordings cannot carry a name: see what they lack, below.",)
    if verdict == "none":
        return _nothing(probabilities)
    if verdict == "none_of_these":
        return _sentences_on_force(left, formula, gain_text)
    said = f"Something is left that this does not say, with a probability of {words.probability(left)}."
    more = (said,) if left > LEFT else ()
    if verdict == "set":
        first = f"Something is missing in the model: {_one_of(causes)}. These recordings cannot tell them apart."
        return (first, *([gain_text] if gain_text else []), *more)
    parts = " and ".join(f"{effect_name(blame.effect)} ({_sizes_of(blame)})" for blame in causes)
    return (f"The model lacks {parts}.", gain_text, *more)


def _nothing(probabilities: Mapping[str, float]) -> tuple[str, ...]:
    """Sentences about a model without additions: because nothing is likelier, or because what is does not predict."""
    likely, probability = max(probabilities.items(), key=lambda pair: pair[1], default=("", 0.0))
    if not likely:
        return ("Nothing is missing that these recordings show.",)
    said = f"{effect_name(likely)[0].upper()}{effect_name(likely)[1:]}"
    if probability > _LIKELIER:
        first = "Nothing can be named: the likeliest cause does not predict motions that it was not fitted to."
        return (first, f"{said} would have a probability of {words.probability(probability)} by the fit alone.")
    if (some := sum(probabilities.values())) > _LIKELIER:
        first = (
            f"Nothing can be named: something is missing with a probability of {words.probability(some)}, spread over "
            "several causes."
        )
        return (first, f"{_leaders_text(probabilities)}; a name takes {100 * NAMED:.0f} %.")
    first = "Nothing is missing that these recordings show: no cause explains them better than the refitted model."
    return (first, f"{said}, the likeliest, has a probability of {words.probability(probability)}.")


def _leaders_text(probabilities: Mapping[str, float]) -> str:
    """The likeliest causes, down to half as likely as the first, with their probabilities."""
    ranked = sorted(probabilities.items(), key=lambda pair: -pair[1])
    leading = [pair for pair in ranked[:_LISTED] if pair[1] >= _BESIDE * ranked[0][1]]
    said = " and ".join(f"{effect_name(name)} ({words.probability(share)})" for name, share in leading)
    return f"Likeliest {'are' if len(leading) > 1 else 'is'} {said}"


def _one_of(causes: Sequence[CauseResult]) -> str:
    """The likeliest in words; how many more there are where they are many."""
    names = [effect_name(blame.effect) for blame in causes]
    few = names if len(names) <= _LISTED else names[: _LISTED - 1]
    more = [f"one of {len(names) - len(few)} more"] if len(few) < len(names) else []
    return " or ".join([*few, *more])


def _sentences_on_force(left: float, formula: Formula | None, gain_text: str) -> tuple[str, ...]:
    first = f"Something acts that no known cause explains, with a probability of {words.probability(left)}."
    if formula is None:
        return (
            first,
            "No force that was tried predicts motions that it was not fitted to: the model is left as it is.",
        )
    return (first, f"It is best said as a force. {formula.words}", gain_text)


def _sizes_of(blame: CauseResult) -> str:
    """Each parameter in words with its value; its name if it has no description."""
    said = [(_meaning(it), _amount(it.value, it.unit)) for it in blame.estimates]
    common = {meaning.rpartition(", ")[0] for meaning, _ in said}
    if len(said) > 1 and len(common) == 1 and (whole := common.pop()):  # Of a vector, the words before its axes once.
        return f"{whole}: " + ", ".join(f"{meaning.rpartition(', ')[2]} {amount}" for meaning, amount in said)
    return "; ".join(f"{meaning}: {amount}" for meaning, amount in said)


def _meaning(estimate: Estimate) -> str:
    about = estimate.about.rstrip(".") or estimate.name.replace("_", " ")
    return about[0].lower() + about[1:]


def _amount(value: float, unit: str) -> str:
    """A number with its unit, short lengths and times in thousandths."""
    if unit in ("m", "s") and abs(value) < _SMALL:
        return f"{float(f'{1e3 * value:.2g}'):g} m{unit}"
    return f"{value:.3g} {'' if unit == '1' else unit}".strip()
