"""Bayesian model comparison: evidence for each cause, while everything else may be a little wrong.

All in steps: an effect at its typical size is 1, and its prior, where it is present, a normal distribution of standard
deviation 1. Where it is absent, it may still be needed a little, because the simulation is not the world even if no
effect is missing in it: `NULL_PRIOR_SD`, the simulator's own errors as they project onto these columns. The unit of
independence is the episode; likelihoods are tempered by the overdispersion of the episodes' scores (Boos 1992, "On
generalized score tests").
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Float64

from app.discovery.dataset.model_under_test import Family
from app.discovery.dataset.object_kinds import LIQUID, ROPE, ObjectTraits
from app.discovery.inference.mixed_effects import Covariances, MixedEffectsFit, QuadraticForms, fit_mixed_effects
from app.discovery.residuals.rows import Residuals
from app.sim.parameter import NullPrior, ParameterSpec

NULL_PRIOR_SD: Mapping[Family, float] = {"sensing": 0.03, "actuation": 0.01, "physics": 0.1}
"""Standard deviation, in steps, of what effects seem to have where nothing is wrong, and where their parameters say
nothing else (`ParameterSpec.null_prior`, `rod_null_prior`, `liquid_null_prior`).

Those of material points were learnt by expectation and maximisation, from 62 recordings of 32 pushes: 39 of our own
engine in other numerics and 23 of MuJoCo's world, which count as much; what was hidden in some of them was left out.
That of mass along the object is MuJoCo's: its rope moves as if its ends were lighter. Those of rods, their own unknowns
and forces of no cause among them, were learnt likewise from 283 recordings of three worlds, ropes, fingers and
frictions drawn for each (docs/discovery-model.md). What has a direction has no mean, and the same in all.
"""
Z90 = 1.645
"""Half width of a 90 % interval, in standard deviations."""
CALIBRATED = 10.0
"""Prior deviation of the calibrated parameters, whose step is 30 %: practically flat."""
NUMERIC = 1.0
_HELD = 1e-9
"""Prior variance of what no datum changes."""
_LEARNT = 12
"""Hypotheses, the likeliest with a noise that is known, for which it is learnt anew."""
_AGAIN = 2
"""Best hypotheses from whose noise nothing missing is weighed again."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Prior:
    """Prior of all columns under the null hypothesis: means and variances in steps. `nuisance`: columns of no cause."""

    mean: Float64[np.ndarray, " P"]
    variance: Float64[np.ndarray, " P"]
    nuisance: tuple[int, ...]

    def wider(self, columns: Sequence[int]) -> "Prior":
        """The prior if the cause with these columns is present."""
        variance = self.variance.copy()
        variance[list(columns)] += 1.0
        return replace(self, variance=variance)

    def without(self, columns: Sequence[int]) -> "Prior":
        """The prior if these columns are what they are usually where nothing is missing, and no datum changes that."""
        variance = self.variance.copy()
        variance[list(columns)] = _HELD
        return replace(self, variance=variance)


def null_prior(family: Family, spec: ParameterSpec, *, rods: bool = False, kind: ObjectTraits = ROPE) -> NullPrior:
    """Null prior of the apparent size of a cause of this family in one of its parameters, in steps."""
    if kind == LIQUID and spec.liquid_null_prior is not None:
        return spec.liquid_null_prior
    if family == "physics" and kind.physics_null_sd is not None:
        return 0.0, kind.physics_null_sd
    if rods and spec.rod_null_prior is not None:
        return spec.rod_null_prior
    if family == "numerics":
        return spec.null_prior or (0.0, NUMERIC)
    return spec.null_prior or (0.0, NULL_PRIOR_SD[family])


class HypothesisResult(NamedTuple):
    """Result of one hypothesis: its log Bayes factor against the null hypothesis, and its columns' posterior."""

    log_bayes: float
    mean: Float64[np.ndarray, " Q"]
    covariance: Float64[np.ndarray, "Q Q"]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ModelComparison:
    """The null hypothesis, and each other against it. `temperature`: see `dispersion`."""

    nothing: MixedEffectsFit
    temperature: float
    log_evidence: float
    findings: tuple[HypothesisResult, ...]


def weigh(data: Residuals, hypotheses: Sequence[Sequence[int]], prior: Prior) -> ModelComparison:
    """Each hypothesis is the columns of one cause, which it frees.

    The noise is learnt anew for each: what an effect does that nobody allows for is taken for noise, just where it
    matters. All begin from the same noises, so that none wins by a better search.
    """
    alone = _fit(data, prior, (None,))
    temperature = dispersion(alone, prior.nuisance)
    causes = [column for column in range(len(prior.mean)) if column not in prior.nuisance]
    wide = _fit(data, prior.wider(causes), (alone.covariances, None))
    starts = (alone.covariances, wide.covariances)
    known = [[_quick(fit.forms, prior, columns, temperature) for fit in (alone, wide)] for columns in hypotheses]
    quick = [max(found, key=_strength) for found in known]
    promising = sorted(range(len(quick)), key=lambda index: -quick[index].log_bayes)[:_LEARNT]
    fits = {index: _fit(data, prior.wider(hypotheses[index]), starts) for index in promising}
    evidences = {index: log_evidence(fit, prior.wider(hypotheses[index]), temperature) for index, fit in fits.items()}
    best = sorted(evidences, key=lambda index: -evidences[index])[:_AGAIN]
    nothing = _fit(data, prior, (*starts, *(fits[index].covariances for index in best)))
    base = log_evidence(nothing, prior, temperature)
    learnt = {
        index: _finding(fit, prior.wider(hypotheses[index]), hypotheses[index], evidences[index] - base, temperature)
        for index, fit in fits.items()
    }
    findings = tuple(learnt.get(index, found) for index, found in enumerate(quick))
    return ModelComparison(nothing=nothing, temperature=temperature, log_evidence=base, findings=findings)


def _quick(forms: QuadraticForms, prior: Prior, columns: Sequence[int], temperature: float) -> HypothesisResult:
    """The same where the noise is taken to be known: exact, and a hundred times as quick as to learn it."""
    A, b = forms.A.sum(0) / temperature, forms.b.sum(0) / temperature

    def solved(own: Prior) -> tuple[float, Float64[np.ndarray, " P"], Float64[np.ndarray, "P P"]]:
        precision = A + np.diag(1 / own.variance)
        pull = b + own.mean / own.variance
        theta = np.linalg.solve(precision, pull)
        occam = np.log(own.variance).sum() + np.linalg.slogdet(precision)[1] + (own.mean**2 / own.variance).sum()
        return 0.5 * float(pull @ theta - occam), theta, precision

    (without, _, _), (evidence, theta, precision) = solved(prior), solved(prior.wider(columns))
    own = list(columns)
    return HypothesisResult(evidence - without, theta[own], np.linalg.inv(precision)[np.ix_(own, own)])


def log_bayes_of(
    scores: Float64[np.ndarray, "D P"], information: Float64[np.ndarray, "P P"], columns: Sequence[int]
) -> Float64[np.ndarray, " D"]:
    """The logarithm of the Bayes factor of a cause of these columns and of typical size, for each row of scores.

    Scores and information are those in which all else has been integrated out already.
    """
    own = list(columns)
    precision = information[np.ix_(own, own)] + np.eye(len(own))
    pull = np.linalg.solve(precision, scores[:, own].T)
    return 0.5 * ((scores[:, own].T * pull).sum(0) - np.linalg.slogdet(precision)[1])


def log_evidence(fit: MixedEffectsFit, prior: Prior, temperature: float) -> float:
    """Laplace's approximation, likelihoods tempered; but for a constant of the data."""
    precision = fit.forms.A.sum(0) / temperature + np.diag(1 / prior.variance)
    occam = np.log(prior.variance).sum() + np.linalg.slogdet(precision)[1]
    misfit = ((fit.theta - prior.mean) ** 2 / prior.variance).sum()
    return fit.log_likelihood / temperature - 0.5 * float(misfit + occam)


def posterior(fit: MixedEffectsFit, prior: Prior, temperature: float) -> Float64[np.ndarray, "P P"]:
    """The covariance of all columns, in steps."""
    return np.linalg.inv(fit.forms.A.sum(0) / temperature + np.diag(1 / prior.variance))


def dispersion(fit: MixedEffectsFit, nuisance: Sequence[int]) -> float:
    """Overdispersion of the episodes' scores relative to independent pushes, at least 1.

    Median over the columns of the ratio of the cluster-robust variance of the efficient score to the model's.
    """
    keep, forms = list(nuisance), fit.forms
    others = [column for column in range(forms.b.shape[1]) if column not in keep]
    A = forms.A.sum(0)
    projection = np.linalg.solve(A[np.ix_(keep, keep)] + 1e-2 * np.eye(len(keep)), A[np.ix_(keep, others)])
    scores = forms.b - forms.A @ fit.theta
    efficient = scores[:, others] - scores[:, keep] @ projection
    model = np.diag(A)[others] - np.einsum("ij,ij->j", A[np.ix_(keep, others)], projection)
    sound = model > 1e-4 * np.diag(A)[others]
    if not sound.any():
        return 1.0
    return max(1.0, float(np.median((efficient**2).sum(0)[sound] / model[sound])))


def project_out(
    A: Float64[np.ndarray, "P P"], prior: Prior, own: Sequence[int]
) -> tuple[list[int], Float64[np.ndarray, "R Q"], Float64[np.ndarray, "Q Q"]]:
    """All else projected out of some columns: the other columns, the projection, and the information that is left.

    `A`: information of all columns, to which priors are added. Scores u become u[own] - u[rest] @ projection.
    """
    columns = list(own)
    rest = [n for n in range(len(A)) if n not in columns]
    projection = np.linalg.solve(A[np.ix_(rest, rest)] + np.diag(1 / prior.variance[rest]), A[np.ix_(rest, columns)])
    return rest, projection, A[np.ix_(columns, columns)] - A[np.ix_(columns, rest)] @ projection


def _strength(finding: HypothesisResult) -> float:
    return finding.log_bayes


def _fit(data: Residuals, prior: Prior, starts: Sequence[Covariances | None]) -> MixedEffectsFit:
    return fit_mixed_effects(data, prior.variance, prior.mean, starts)


def _finding(
    fit: MixedEffectsFit, prior: Prior, columns: Sequence[int], log_bayes: float, temperature: float
) -> HypothesisResult:
    own = list(columns)
    return HypothesisResult(log_bayes, fit.theta[own], posterior(fit, prior, temperature)[np.ix_(own, own)])
