"""The open-ended part: a force of no cause of the catalogue, as the fewest features of a library that explain it.

Forward selection, each feature refitted with friction and stiffness by Gauss-Newton about itself, as causes are
(`refine`). A formula is accepted where it makes the data enough more likely and predicts left-out episodes better by
two standard errors: than nothing, and than the causes that were accepted. Being of no catalogue counts as one cause
more: what a known cause explains nearly as well has its name.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, final

from app.discovery.dataset.model_under_test import Catalogue, Theta
from app.discovery.inference.decide import ENOUGH, ModelSelection, Progress
from app.discovery.inference.held_out import held_out_gain, is_earned
from app.discovery.inference.refine import RefinedModel, refine, start_of
from app.discovery.inference.screen import CandidateCause, Screening
from app.discovery.inference.weighing import HypothesisResult, Prior, log_evidence, weigh
from app.discovery.residuals.forces import FEATURES, FORMULA, parameters, with_formula
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.rows import Residuals
from app.discovery.residuals.sensitivity import Step
from app.discovery.residuals.simulation_batch import SimulationBatch
from app.discovery.unexplained.basis_functions import BasisFunctions, Widened, library
from app.discovery.unexplained.residual_test import ResidualTest, leftover, something_left

_MOST = 3
"""Features of a formula."""
_WORTH = 5.0
"""Logarithm of the Bayes factor, with slopes about the model without it, from which a feature is worth a refit."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class AcceptedFormula:
    """A formula that was accepted: its features and their fit, whose only cause is `FORMULA` of `catalogue`."""

    features: tuple[str, ...]
    model: RefinedModel
    catalogue: Catalogue


class UnexplainedForce(NamedTuple):
    """Result of the open-ended part: the residual test of the accepted model, and a formula that is better than it."""

    left: ResidualTest
    found: AcceptedFormula | None


NO_FORCE: Final = UnexplainedForce(ResidualTest(probability=float("nan"), by_chance=float("nan")), None)
"""Result where none was looked for: nothing is known of what is left, and a verdict is as where nothing is."""


class _Rival(NamedTuple):
    """A model that the formula has to beat, with the features as further columns; `causes`: how many it has."""

    data: Residuals
    prior: Prior
    log_evidence: float
    causes: int
    accepted: bool


def fit_unexplained_force(
    predictor: Predictor, trials: SimulationBatch, screening: Screening, decision: ModelSelection, said: Progress
) -> UnexplainedForce:
    """Test the residuals of the decision, and look for a formula that explains them better."""
    known = library(predictor, trials, screening)
    nothing = known.beside_nothing(screening)
    beside = nothing if decision.accepted is None else known.beside(decision.accepted)
    left = leftover(beside)
    found = _search(predictor, trials, known.screening(screening, nothing), nothing, said)
    if found is None:
        return UnexplainedForce(left, None)
    rivals = _rivals(known, nothing, decision, beside)
    if not all(_beats(found, rival) for rival in rivals):
        return UnexplainedForce(left, None)
    gain = found.model.log_evidence - max(rival.log_evidence for rival in rivals)
    return UnexplainedForce(left._replace(probability=max(left.probability, something_left([gain]))), found)


def _search(
    predictor: Predictor, trials: SimulationBatch, screening: Screening, wide: Widened, said: Progress
) -> AcceptedFormula | None:
    """The best feature, and further ones while each is needed."""
    best: AcceptedFormula | None = None
    suspects = {
        feature: _suspect(screening.steps, columns, finding)
        for (feature, columns), finding in zip(wide.at.items(), wide.weighing.findings, strict=True)
    }
    while suspects and len(best.features if best else ()) < _MOST:
        feature, suspect = max(suspects.items(), key=lambda pair: pair[1].finding.log_bayes)
        if suspect.finding.log_bayes < _WORTH:
            break
        features = (*(best.features if best else ()), feature)
        said(f"refitting a force: {', '.join(features).replace('_', ' ')}")
        better = _refine(predictor, trials, screening, features, best.model.estimate if best else None, suspect)
        if best is not None and not _is_needed(best.model, better.model):
            break
        best, suspects = better, _further(better)
    return best


def _refine(
    predictor: Predictor,
    trials: SimulationBatch,
    screening: Screening,
    features: tuple[str, ...],
    about: Theta | None,
    suspect: CandidateCause,
) -> AcceptedFormula:
    """Refit of these features together, the last from the screening and the others from `about`."""
    catalogue = with_formula(predictor.catalogue, features)
    start = start_of(catalogue, screening.about if about is None else about, suspect)
    model = refine(Predictor(predictor.subject, catalogue), trials, screening, [(FORMULA, start)])
    return AcceptedFormula(features=features, model=model, catalogue=catalogue)


def _is_needed(simpler: RefinedModel, model: RefinedModel) -> bool:
    """True if a further feature makes all data likely enough, and left-out episodes more likely."""
    if model.log_evidence < simpler.log_evidence + ENOUGH:
        return False
    return is_earned(held_out_gain((simpler.data, simpler.prior), model))


def _further(found: AcceptedFormula) -> dict[str, CandidateCause]:
    """Features that the formula does not have, as its own residuals see them."""
    model, at = found.model, dict[str, tuple[int, ...]]()
    for feature in FEATURES:
        wanted = {found.catalogue.column(name) for name in parameters([feature])}
        columns = [n for n in range(model.own, len(model.steps)) if model.steps[n].column in wanted]
        if feature not in found.features and columns:
            at[feature] = tuple(columns)
    weighing = weigh(model.data, list(at.values()), model.prior)
    return {
        feature: _suspect(model.steps, columns, finding)
        for (feature, columns), finding in zip(at.items(), weighing.findings, strict=True)
    }


def _suspect(steps: Sequence[Step], columns: Sequence[int], finding: HypothesisResult) -> CandidateCause:
    own = tuple(steps[column] for column in columns)
    return CandidateCause(cause=FORMULA, columns=tuple(columns), steps=own, finding=finding)


def _rivals(known: BasisFunctions, nothing: Widened, decision: ModelSelection, beside: Widened) -> list[_Rival]:
    """Rivals of a formula: nothing missing, the accepted causes, and the likeliest cause if it was not accepted."""
    temperature = nothing.weighing.temperature

    def rival(wide: Widened, causes: int, *, accepted: bool) -> _Rival:
        evidence = log_evidence(wide.weighing.nothing, wide.prior, temperature)
        return _Rival(wide.data, wide.prior, evidence, causes, accepted)

    if decision.accepted is not None:
        return [rival(nothing, 0, accepted=True), rival(beside, len(decision.accepted.causes), accepted=True)]
    return [rival(nothing, 0, accepted=True), rival(known.beside(decision.singles[0]), 1, accepted=False)]


def _beats(found: AcceptedFormula, rival: _Rival) -> bool:
    """True if the formula is clearly better than an accepted model, or at all better than one that is not.

    Each feature needs the evidence of a cause, and being unknown as much again against a cause with a name.
    """
    gain = found.model.log_evidence - rival.log_evidence
    if not rival.accepted:
        return gain > 0
    more = len(found.features) + (rival.causes > 0) - rival.causes
    held = held_out_gain((rival.data, rival.prior), found.model)
    return gain > more * ENOUGH and held.gain > (2 if more > 0 else -2) * held.error
