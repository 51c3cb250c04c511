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

from app.discovery.dataset.model_under_test import Cause, Family
from app.discovery.inference.mixed_effects import Covariances, MixedEffectsFit, QuadraticForms, fit_mixed_effects
from app.discovery.residuals.rows import Residuals

NULL_PRIOR_SD: Mapping[Family, float] = {"sensing": 0.03, "actuation": 0.01, "physics": 0.1}
"""Standard deviation, in steps, of what effects seem to have where nothing is wrong."""
_OWN_NULL_PRIOR_SD: Mapping[str, float] = {
    "finger_friction": 0.2,
    "friction_anisotropy": 0.14,
    "friction_map": 0.12,
    "mask_erosion": 0.15,
    "mass_heterogeneity": 0.5,
    "maxwell": 0.3,
    "plastic_yield": 0.05,
    "stiffness_heterogeneity": 0.17,
    "tcp_offset": 0.04,
}
"""Exceptions to it. That of mass along the object is MuJoCo's: its rope moves as if its ends were lighter."""
_NULL_PRIOR_MEAN: Mapping[str, float] = {"mask_erosion": -0.29}
"""Means under the null hypothesis, where they are not 0. Like the deviations they were learnt by expectation and
maximisation, from 62 recordings of 32 pushes: 39 of our own engine in other numerics and 23 of MuJoCo's world, which
count as much; what was hidden in some of them was left out."""
ROD_NULL_PRIOR: Mapping[str, tuple[float, float]] = {
    "anisotropy_axes": (0.0, 0.081),
    "anisotropy_diagonals": (0.0, 0.081),
    "attraction": (0.0, 0.101),
    "bend_yield": (-0.023, 1.013),
    "bending_viscosity": (-0.599, 1.085),
    "constraint_rate": (0.0, 0.563),
    "contact_distance": (-0.429, 0.724),
    "drag": (-0.274, 0.148),
    "drag_squared": (-0.009, 0.059),
    "draught_x": (0.0, 0.049),
    "draught_y": (0.0, 0.049),
    "film_drag": (0.339, 0.539),
    "finger_climb": (-0.21, 0.789),
    "finger_friction": (0.195, 0.26),
    "finger_press": (1.116, 1.456),
    "friction_drift": (0.016, 0.055),
    "friction_slope_x": (0.0, 0.138),
    "friction_slope_y": (0.0, 0.138),
    "friction_step": (0.0, 0.044),
    "growth_x": (0.0, 0.027),
    "growth_y": (0.0, 0.027),
    "lasting_bends": (0.263, 0.385),
    "mass_bow": (0.21, 0.446),
    "mass_slope": (0.0, 0.16),
    "obstacle_rate": (0.0, 0.462),
    "push_x": (0.0, 0.01),
    "push_y": (0.0, 0.01),
    "relaxation_rate": (0.004, 0.468),
    "rest_curvature": (0.0, 0.269),
    "rope_mass": (-0.221, 1.543),
    "sideways": (0.0, 0.011),
    "sideways_rate": (0.0, 0.023),
    "solid_viscosity": (-0.007, 1.893),
    "spread": (-0.004, 0.01),
    "stiffness_bow": (0.033, 0.288),
    "stiffness_slope": (0.0, 0.237),
    "stiffness_step": (0.0, 0.047),
    "stretch_axes": (0.0, 0.008),
    "stretch_diagonals": (0.0, 0.008),
    "stribeck_excess": (0.0, 0.174),
    "swirl": (0.0, 0.008),
    "tilt_x": (0.0, 0.06),
    "tilt_y": (0.0, 0.06),
    "yield_softness": (0.404, 0.554),
}
"""The same of rods, mean and deviation of each parameter, their own unknowns and forces of no cause among them: learnt
by expectation and maximisation from 283 recordings of three worlds, ropes, fingers and frictions drawn for each, what
was hidden in some of them left out (docs/discovery-model.md). What has a direction has no mean, and the same in all."""
Z90 = 1.645
"""Half width of a 90 % interval, in standard deviations."""
CALIBRATED = 10.0
"""Prior deviation of the calibrated parameters, whose step is 30 %: practically flat."""
NUMERIC = 1.0
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


def null_prior(cause: Cause, parameter: str = "", *, rods: bool = False) -> tuple[float, float]:
    """Null prior of a cause's apparent size, in steps: mean and standard deviation."""
    if rods and parameter in ROD_NULL_PRIOR:
        return ROD_NULL_PRIOR[parameter]
    if cause.family == "numerics":
        return 0.0, NUMERIC
    return _NULL_PRIOR_MEAN.get(cause.name, 0.0), _OWN_NULL_PRIOR_SD.get(cause.name, NULL_PRIOR_SD[cause.family])


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
