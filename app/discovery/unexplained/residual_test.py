"""Residual test of a model against every feature of the library: the probability that something is left unexplained.

The score of each feature, everything else projected out, is a sum over episodes, which are independent. If nothing is
left, each episode's share is as likely to be of either sign; so random signs give the distribution of the evidence of
the likeliest of all features by chance (a wild bootstrap with Rademacher's signs; Cameron, Gelbach and Miller 2008,
"Bootstrap-based improvements for inference with clustered errors"), to which the simulator's own errors are added. No
distribution of squared residuals is assumed: chi-square finds something in every recording.
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from app.discovery.inference.decide import TEMPERATURE
from app.discovery.inference.mixed_effects import QuadraticForms, fit_mixed_effects
from app.discovery.inference.weighing import Prior, log_bayes_of
from app.discovery.unexplained.basis_functions import Widened

LEFT = 0.95
"""Probability above which something is left."""
_BEFORE = 0.25
"""Prior probability that something is left."""
_DRAWS = 4000


class ResidualTest(NamedTuple):
    """The probability that something is left, and the p-value of that.

    Of E episodes chance can be excluded no further than to about one in 2^E, and the probability is no higher than
    what that leaves.
    """

    probability: float
    by_chance: float


class _Scores(NamedTuple):
    """Scores of the features, all else projected out: each episode's, and the information of all."""

    each: Float64[np.ndarray, "E F"]
    information: Float64[np.ndarray, "F F"]


def leftover(wide: Widened) -> ResidualTest:
    """Test of the model that these residuals are of."""
    probability = something_left([finding.log_bayes for finding in wide.weighing.findings])
    chance = by_chance(_scores(wide), _groups(wide), _deviations(wide))
    return ResidualTest(probability=min(probability, 1 - chance), by_chance=chance)


def something_left(log_bayes: Sequence[float]) -> float:
    """The probability of any of what would be left, by the logarithms of their Bayes factors against nothing."""
    shares = np.log(_BEFORE / len(log_bayes)) + np.array(log_bayes) / TEMPERATURE
    logs = np.concatenate([[np.log(1 - _BEFORE)], shares])
    weights = np.exp(logs - logs.max())
    return 1 - float(weights[0] / weights.sum())


def by_chance(
    scores: _Scores, groups: Sequence[Sequence[int]], deviations: Float64[np.ndarray, " F"], seed: int = 0
) -> float:
    """P-value of the whole family: the rate at which random signs make the likeliest group at least as likely as it is.

    `deviations`: of the features' apparent sizes under the null hypothesis, in steps.
    """
    rng = np.random.default_rng(seed)
    signs = rng.choice([-1.0, 1.0], (_DRAWS, len(scores.each)))
    habits = rng.normal(0, deviations, (_DRAWS, len(scores.information)))
    drawn = signs @ scores.each + habits @ scores.information
    found = _likeliest(scores.each.sum(0)[None], scores.information, groups)[0]
    # Equal sums of the same numbers differ by rounding.
    as_likely = _likeliest(drawn, scores.information, groups) >= found - 1e-9 * abs(found)
    return float((1 + as_likely.sum()) / (1 + _DRAWS))


def _likeliest(
    totals: Float64[np.ndarray, "D F"], information: Float64[np.ndarray, "F F"], groups: Sequence[Sequence[int]]
) -> Float64[np.ndarray, " D"]:
    """The largest of the groups' logarithmic Bayes factors, where a feature that is there is of typical size."""
    return np.max([log_bayes_of(totals, information, group) for group in groups], axis=0)


def _scores(wide: Widened) -> _Scores:
    """Scores with the noise learnt while all features are free: else their effects are taken for noise."""
    columns = sorted({column for own in wide.at.values() for column in own})
    prior = wide.prior.wider(columns)
    starts = (wide.weighing.nothing.covariances, None)
    return project_onto(fit_mixed_effects(wide.data, prior.variance, prior.mean, starts).forms, wide.prior, columns)


def project_onto(forms: QuadraticForms, prior: Prior, columns: Sequence[int]) -> _Scores:
    """The scores of these columns at zero, where all others are at their most probable."""
    own, rest = list(columns), [n for n in range(len(prior.mean)) if n not in set(columns)]
    A, b = forms.A.sum(0), forms.b.sum(0)
    precision = A[np.ix_(rest, rest)] + np.diag(1 / prior.variance[rest])
    theta = np.linalg.solve(precision, b[rest] + prior.mean[rest] / prior.variance[rest])
    cross = A[np.ix_(rest, own)]
    projection = np.linalg.solve(precision, cross)
    scores = forms.b - forms.A[:, :, rest] @ theta
    return _Scores(
        each=scores[:, own] - scores[:, rest] @ projection,
        information=A[np.ix_(own, own)] - cross.T @ projection,
    )


def _deviations(wide: Widened) -> Float64[np.ndarray, " F"]:
    """Prior deviations of the features' columns."""
    return np.sqrt(wide.prior.variance[sorted({column for own in wide.at.values() for column in own})])


def _groups(wide: Widened) -> list[list[int]]:
    """The features' columns, counted from the first of them all."""
    first = min(column for own in wide.at.values() for column in own)
    return [[column - first for column in own] for own in wide.at.values()]
