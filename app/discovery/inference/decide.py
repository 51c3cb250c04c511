"""Selection between suspects: the best of them refitted, a second and a third cause if the first is not enough.

A cause is accepted where it makes the data enough more likely, and where episodes that it was not fitted to are
predicted better. Evidence is of two kinds. That of the screening weighs all causes with the same simulations, and so
fairly, but as if what they do were linear. That of a refit knows what they really do; but pushes are chaotic, so that
simulated anew under a model that is hardly another one they are 20 to 60 nats more or less likely, and the best of
several rounds finds some of them where nothing is. Either counts as far as development recordings showed it to. A
liquid is not chaotic: there the evidence of a refit is worth that of the screening.
"""

from collections.abc import Callable, Collection, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.discovery.dataset.model_under_test import Catalogue, Theta
from app.discovery.dataset.object_kinds import ObjectTraits
from app.discovery.inference.calibration import calibration
from app.discovery.inference.held_out import (
    HeldOutGain,
    earned_by_either,
    held_out_gain,
    held_out_gain_of_linear,
    is_earned,
)
from app.discovery.inference.refine import RefinedModel, refine, start_of
from app.discovery.inference.screen import CandidateCause, Screening
from app.discovery.inference.weighing import Z90, weigh
from app.discovery.residuals.forces import FORMULA
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.sensitivity import Step, apply_step, hypotheses_of
from app.discovery.residuals.simulation_batch import SimulationBatch

TEMPERATURE = 2.0
"""Temperature of the screening's log evidence: every simulator is wrong in ways that no cause of the catalogue is."""
_LINEAR = 20.0
"""Evidence of the screening above which only a refit counts: strong effects are not linear."""
CHANCE = 50.0
"""Evidence that refits find where nothing is: in 18 recordings the best cause had 32 in the median, 64 once."""
_ROUGH = 10.0
"""Divisor of a refit's further evidence."""
_ODDS = 0.09
"""Prior odds of each cause against nothing missing: three to one that one of a whole catalogue of 34 acts. Who asks
about a few of them alone does not make these more probable."""
_DOUBT = 0.1
"""Probability of nothing missing from which no cause is taken for present: a set that holds 90 % would hold it, too."""
_PLAIN = 10.0
"""Evidence of a liquid's cause [nats] that need not make left-out episodes likelier; at most 1 of nothing."""
_SHARES = 1.0, 0.4
"""Shares of the screening's estimate at which refits start: strong effects are often overestimated there."""
NAMED = 0.8
"""Probability above which a cause is named alone."""
_SHORTLIST = 5
_WORTH = 0.05
"""Probability above which a cause is refitted."""
_RIVAL = 0.5
"""Share of the likeliest's evidence from which another strong error of cameras or arm is refitted besides."""
_AT_END = 0.05
"""Tolerance, in steps, within which a parameter is at the end of its range."""
_CLOSE = 3.0
"""Suspects whose evidence is so near the last of the shortlist's are on it, too."""
_MOST = 3
_APPARATUS = "sensing", "actuation"
_ASKED = 2
"""Candidates for a further cause that are refitted, and rivals of a strong one."""
ENOUGH = CHANCE + _ROUGH
"""Logarithm of the Bayes factor that a further cause must have against the model without it, both refitted."""

Progress: TypeAlias = Callable[[str], None]
"""Callback for progress, in words."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ModelSelection:
    """The refitted singles, the most probable first, and the model that is accepted, if any.

    `probabilities` of each cause alone, `unknown` of a force of none of them, which is not weighed in material points;
    what is left to 1 is that nothing is missing. `held`: of the best, None where it is too improbable to be accepted.
    """

    singles: tuple[RefinedModel, ...]
    probabilities: Mapping[str, float]
    nothing: float
    accepted: RefinedModel | None
    held: HeldOutGain | None
    unknown: float = 0.0


def decide(predictor: Predictor, trials: SimulationBatch, screening: Screening, said: Progress) -> ModelSelection:
    """Refit the shortlist, weigh it, and add causes while they are needed.

    Of rods how probable a cause is was measured (`calibration`), and a refit only says how large it is, and which of
    two strong errors of cameras and arm it is (`settle_strong`). A further one is asked about where the first makes
    left-out episodes more likely.
    """
    singles, catalogue = list[RefinedModel](), predictor.catalogue
    measured = calibration().probabilities(screening) if catalogue.rods else None
    unknown = 0.0 if measured is None else measured[0].get(FORMULA, 0.0)
    # A refit of pieces, simulated from several beginnings, or of a liquid takes as long as a quarter of the screening.
    kind = catalogue.kind
    first = measured or (probabilities_of(screening, (), kind) if not kind.has_length else None)
    strong = _strong_errors(catalogue, screening) if catalogue.rods else frozenset[str]()
    for suspect in shortlist(screening) if first is None else _probable(screening, first[0], strong):
        said(f"refitting {suspect.cause}")
        probable = first is None or first[0][suspect.cause] > _WORTH or suspect.cause in strong
        singles.append(refit_cause(predictor, trials, screening, suspect, thorough=probable))
    probabilities, nothing = measured or probabilities_of(screening, singles, kind)
    probabilities = {cause: value for cause, value in probabilities.items() if cause != FORMULA}
    singles.sort(key=lambda model: -probabilities[model.causes[0]])
    if singles[0].causes[0] in strong:
        refitted = [model for model in singles if model.causes[0] in strong]
        promised = {
            suspect.cause: screening.weighing.log_evidence + suspect.finding.log_bayes for suspect in screening.suspects
        }
        probabilities = settle_strong(catalogue, probabilities, refitted, promised)
        singles.sort(key=lambda model: -probabilities[model.causes[0]])
    best = singles[0]
    sure = nothing < _DOUBT and (unknown < _DOUBT or probabilities[best.causes[0]] > NAMED)
    held = held_out_gain((screening.data, screening.prior), best) if sure else None
    if held is not None and (not catalogue.rods or held.gain > held.error):
        more = _add_causes(predictor, trials, screening, best, singles, said)
        if more is not best:
            gained = held_out_gain((screening.data, screening.prior), more)
            if _is_accepted(catalogue, more, gained):
                best, held = more, gained
    if held is not None and catalogue.rods and not is_earned(held) and len(best.causes) == 1:
        (suspect,) = (suspect for suspect in screening.suspects if suspect.cause == best.causes[0])
        linear = held_out_gain_of_linear(screening, suspect, rivals_of(catalogue, screening, suspect))
        held = earned_by_either(held, linear, best.log_evidence - screening.weighing.log_evidence)
    surplus = best.log_evidence - screening.weighing.log_evidence if kind.is_smooth else 0.0
    return ModelSelection(
        singles=tuple(singles),
        probabilities=probabilities,
        nothing=nothing,
        accepted=best if held is not None and _is_accepted(catalogue, best, held, surplus) else None,
        held=held,
        unknown=unknown,
    )


def _is_accepted(catalogue: Catalogue, model: RefinedModel, held: HeldOutGain, surplus: float = 0.0) -> bool:
    """True if left-out episodes bear a model out, and if all of its causes are of some size.

    A liquid's cause is told from nothing also by how far numerics would have to be from where they usually are, which
    makes left-out episodes no likelier: a `surplus` of evidence [nats] is enough if these do not contradict.
    """
    if catalogue.rods:
        return is_earned(held) and is_sized(catalogue, model)
    return held.gain > held.error or (surplus > _PLAIN and held.gain > -held.error)


def rivals_of(catalogue: Catalogue, screening: Screening, suspect: CandidateCause) -> list[int]:
    """Steps of other errors of cameras and arm, where a cause is one: they are nearly the same for each other.

    Physics have no such rivals: there, what causes usually seem to be are the simulator's own errors.
    """
    return _rivals(catalogue, screening.steps, suspect.cause)


def without_rivals(catalogue: Catalogue, model: RefinedModel, further: str) -> RefinedModel:
    """The model without the other errors of cameras and arm, where a `further` cause is one.

    A model that may have a little of it learns all of it from the other episodes, and nothing more can be gained.
    """
    rivals = [n for n in _rivals(catalogue, model.steps, further) if n >= model.own]
    return replace(model, prior=model.prior.without(rivals))


def _rivals(catalogue: Catalogue, steps: Sequence[Step], cause: str) -> list[int]:
    """Steps of errors of cameras and arm, where a cause is one."""
    apparatus = _apparatus(catalogue)
    return [n for n, step in enumerate(steps) if step.cause in apparatus] if cause in apparatus else []


def _apparatus(catalogue: Catalogue) -> frozenset[str]:
    """Causes that are errors of cameras or arm."""
    return frozenset(cause.name for cause in catalogue.causes if cause.family in _APPARATUS)


def _probable(
    screening: Screening, probabilities: Mapping[str, float], strong: Collection[str]
) -> list[CandidateCause]:
    """The suspects that are worth a refit by their probability so far; one at least.

    `strong`: errors of cameras and arm, of which those with the most evidence are refitted beside a likelier one.
    """
    suspects = sorted(screening.suspects, key=lambda suspect: -probabilities[suspect.cause])
    probable = [suspect for suspect in suspects[:_SHORTLIST] if probabilities[suspect.cause] > _WORTH] or suspects[:1]
    if suspects[0].cause not in strong:
        return probable
    least = _RIVAL * suspects[0].finding.log_bayes
    rivals = [each for each in screening.suspects if each.cause in strong and each.finding.log_bayes > least]
    return probable + [rival for rival in rivals[: 1 + _ASKED] if rival not in probable]


def _strong_errors(catalogue: Catalogue, screening: Screening) -> frozenset[str]:
    """Errors of cameras and arm whose evidence by the screening is so large that only refits count."""
    strong = {suspect.cause for suspect in screening.suspects if suspect.finding.log_bayes > _LINEAR}
    return _apparatus(catalogue) & strong


def settle_strong(
    catalogue: Catalogue,
    probabilities: Mapping[str, float],
    refitted: Sequence[RefinedModel],
    promised: Mapping[str, float],
) -> dict[str, float]:
    """Probabilities in which a strong error of cameras or arm has those of others that refits rule out.

    What a strong error does is not linear in its size: cameras that are turned by a typical angle see everything a
    centimetre aside, which slopes about the nominal model explain as a shift, with a third of the evidence that
    either has once it is refitted. `refitted`: the likeliest first. The best of them, or else the likeliest, rules out
    those whose evidence, refitted and as the screening `promised`, is less by more than chaos makes of refits, if
    left-out episodes bear it out.
    """

    def rules_out(model: RefinedModel, other: RefinedModel) -> bool:
        least = max(other.log_evidence, promised[other.causes[0]]) + CHANCE
        return model.log_evidence > least and is_earned(held_out_gain((other.data, other.prior), model))

    likeliest, found = refitted[0], dict(probabilities)
    best = max(refitted, key=lambda model: model.log_evidence)
    if not is_sized(catalogue, best):
        best = likeliest
    out = [other for other in refitted if rules_out(best, other)]
    if best is not likeliest and likeliest not in out:
        best, out = likeliest, [other for other in refitted if rules_out(likeliest, other)]
    for other in out:
        found[best.causes[0]] += found[other.causes[0]]
        found[other.causes[0]] = 0.0
    return found


def is_sized(catalogue: Catalogue, model: RefinedModel) -> bool:
    """True if every cause of a model is present by its interval, and none is at the end of its range."""
    deviations = np.sqrt(np.diag(model.covariance))
    for name in model.causes:
        switches, present = catalogue.cause(name).columns[: catalogue.cause(name).switches], False
        for step, deviation in zip(model.steps[: model.own], deviations, strict=True):
            if step.column not in switches:
                continue
            spec = catalogue.specs[step.column]
            here, null = (spec.coordinate(value) for value in (float(model.estimate[step.column]), spec.nominal))
            ends = [spec.coordinate(end) for end in (spec.low, spec.high) if end != spec.nominal]
            if min(abs(here - end) for end in ends) < _AT_END * abs(step.size):
                return False
            present |= abs(here - null) > Z90 * deviation * abs(step.size)
        if not present:
            return False
    return True


def refit_cause(
    predictor: Predictor,
    trials: SimulationBatch,
    screening: Screening,
    suspect: CandidateCause,
    *,
    thorough: bool = True,
) -> RefinedModel:
    """Refit with this cause alone, from the screening's estimate; if `thorough` from less if that improves nothing."""
    if not thorough:
        start = start_of(predictor.catalogue, screening.about, suspect)
        return refine(predictor, trials, screening, [(suspect.cause, start)], rounds=1)
    best: RefinedModel | None = None
    for share in _SHARES:
        start = start_of(predictor.catalogue, screening.about, suspect, share=share)
        model = refine(predictor, trials, screening, [(suspect.cause, start)])
        if best is None or model.log_evidence > best.log_evidence:
            best = model
        if best.log_evidence > screening.weighing.log_evidence:
            break
    assert best is not None
    return best


def shortlist(screening: Screening) -> list[CandidateCause]:
    """The suspects worth a refit."""
    suspects = screening.suspects
    least = suspects[min(_SHORTLIST, len(suspects)) - 1].finding.log_bayes - _CLOSE
    close = [suspect for suspect in suspects if suspect.finding.log_bayes > max(least, 0.0)]
    return close[: _SHORTLIST + _ASKED] or list(suspects[:1])


def probabilities_of(
    screening: Screening, singles: Sequence[RefinedModel], kind: ObjectTraits
) -> tuple[Mapping[str, float], float]:
    """Probabilities of each cause, and of none; of those not refitted by the screening's evidence alone."""
    linear = {suspect.cause: suspect.finding.log_bayes for suspect in screening.suspects}
    refitted = {model.causes[0]: model.log_evidence - screening.weighing.log_evidence for model in singles}
    weight = _smooth_weight if kind.is_smooth else _weight
    return _normalize({cause: weight(value, refitted.get(cause)) for cause, value in linear.items()})


def likeliest_cause(linear: Mapping[str, float]) -> str | None:
    """The cause that is the most probable by the screening's evidence; None where nothing missing is more probable."""
    probabilities, nothing = _normalize({cause: value / TEMPERATURE for cause, value in linear.items()})
    cause = max(probabilities, key=lambda cause: probabilities[cause])
    return cause if probabilities[cause] > nothing else None


def _weight(linear: float, refitted: float | None) -> float:
    """Tempered log Bayes factor of a cause against nothing missing."""
    weight = min(linear, _LINEAR) / TEMPERATURE
    return weight if refitted is None else max(weight, (refitted - CHANCE) / _ROUGH)


def _smooth_weight(linear: float, refitted: float | None) -> float:
    """The same where a simulation changes by little with its model: strong effects count by their refits."""
    weight = min(linear, _LINEAR)
    return (weight if refitted is None else max(weight, refitted)) / TEMPERATURE


def _normalize(logs: Mapping[str, float]) -> tuple[Mapping[str, float], float]:
    """Probabilities from logarithmic weights against nothing missing, and that of nothing missing."""
    weights = np.array([0.0, *(np.log(_ODDS) + value for value in logs.values())])
    probabilities = np.exp(weights - weights.max())
    probabilities /= probabilities.sum()
    return dict(zip(logs, probabilities[1:].tolist(), strict=True)), float(probabilities[0])


def _add_causes(
    predictor: Predictor,
    trials: SimulationBatch,
    screening: Screening,
    best: RefinedModel,
    singles: Sequence[RefinedModel],
    said: Progress,
) -> RefinedModel:
    """The best model with more causes, while each makes the data enough more likely; none that is not needed."""
    starts = {model.causes[0]: model.estimate for model in singles}
    while len(best.causes) < _MOST:
        found = list[RefinedModel]()
        for suspect in further_suspects(best)[:_ASKED]:
            said(f"adding {suspect.cause} to {', '.join(best.causes)}")
            found.append(with_further(predictor, trials, screening, best, suspect, starts.get(suspect.cause)))
        better = max(found, key=lambda model: model.log_evidence, default=None)
        if better is None or better.log_evidence < best.log_evidence + ENOUGH:
            return best
        simpler, larger = (without_rivals(predictor.catalogue, each, better.causes[-1]) for each in (best, better))
        gained = held_out_gain((simpler.data, simpler.prior), larger)
        if not is_earned(gained):
            return best
        best = _without_needless(better, [best, *singles])
    return best


def with_further(
    predictor: Predictor,
    trials: SimulationBatch,
    screening: Screening,
    model: RefinedModel,
    suspect: CandidateCause,
    start: Theta | None = None,
) -> RefinedModel:
    """The model with a further cause, refitted; from that cause's value in `start`, or as the screening found it."""
    start = start_of(predictor.catalogue, screening.about, suspect) if start is None else start
    both = [*((name, model.estimate) for name in model.causes), (suspect.cause, start)]
    return refine(predictor, trials, screening, both, (model.fit.covariances,))


def _without_needless(model: RefinedModel, simpler: Sequence[RefinedModel]) -> RefinedModel:
    """A simpler model with some of its causes that is nearly as likely, or itself."""
    for other in sorted(simpler, key=lambda other: -other.log_evidence):
        if set(other.causes) < set(model.causes) and other.log_evidence > model.log_evidence - ENOUGH:
            return other
    return model


def further_suspects(model: RefinedModel) -> list[CandidateCause]:
    """Suspects for a further cause, the most likely first, by what a model leaves unexplained."""
    free = [n for n in range(model.own, len(model.steps)) if n not in model.prior.nuisance]
    groups = hypotheses_of(model.steps, (n for n in free if model.steps[n].cause not in (*model.causes, FORMULA)))
    weighing = weigh(model.data, list(groups.values()), model.prior)
    suspects = [
        CandidateCause(
            cause=cause,
            columns=tuple(columns),
            steps=tuple(model.steps[column] for column in columns),
            finding=finding,
        )
        for (cause, _), columns, finding in zip(groups, groups.values(), weighing.findings, strict=True)
    ]
    suspects.sort(key=lambda suspect: -suspect.finding.log_bayes)
    first = dict[str, CandidateCause]()
    for suspect in suspects:
        if suspect.finding.log_bayes > 0:
            first.setdefault(suspect.cause, suspect)
    return list(first.values())


def theta_of(catalogue: Catalogue, model: RefinedModel, shares: Float64[np.ndarray, " Q"]) -> Theta:
    """The model's theta moved by so many of its own steps."""
    theta = model.theta
    for step, share in zip(model.steps[: model.own], shares, strict=True):
        theta = apply_step(catalogue, theta, step, float(share))
    return theta
