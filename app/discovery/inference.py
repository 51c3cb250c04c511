"""Which cause is probable: evidence for each, while everything else may be a little wrong.

All in steps: an effect at its typical size is 1, and its prior, where it is present, a normal distribution of standard
deviation 1. Where it is not, it may still be needed a little, because the simulation is not the world even when nothing
is missing in it: `HABITS`, the simulator's own errors as they look in these columns. The unit of independence is the
episode; likelihoods are tempered by how much the episodes' scores really scatter (Boos 1992, "On generalized score
tests").
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from app.discovery.evidence import Fit, Residuals, fitted

HABITS = 0.08
"""Standard deviation, in steps, of what every effect seems to have where nothing is wrong."""
CALIBRATED = 10.0
"""That of the calibrated parameters, whose step is 30 %: anything."""
NUMERIC = 1.0


class Finding(NamedTuple):
    """Of one hypothesis: the logarithm of its Bayes factor against nothing missing, and its columns' posterior."""

    log_bayes: float
    mean: Float64[np.ndarray, " Q"]
    covariance: Float64[np.ndarray, "Q Q"]


def dispersion(fit: Fit, nuisance: Sequence[int]) -> float:
    """By how much the episodes' scores scatter more than independent pushes would, at least 1.

    Median over the columns of the ratio of the cluster-robust variance of the efficient score to the model's.
    """
    episodes = fit.forms.by_episode()
    keep = list(nuisance)
    others = [column for column in range(episodes.b.shape[1]) if column not in keep]
    A = episodes.A.sum(0)
    projection = np.linalg.solve(A[np.ix_(keep, keep)] + 1e-2 * np.eye(len(keep)), A[np.ix_(keep, others)])
    scores = episodes.b - episodes.A @ fit.theta
    efficient = scores[:, others] - scores[:, keep] @ projection
    model = np.diag(A)[others] - np.einsum("ij,ij->j", A[np.ix_(keep, others)], projection)
    sound = model > 1e-4 * np.diag(A)[others]
    if not sound.any():
        return 1.0
    return max(1.0, float(np.median((efficient**2).sum(0)[sound] / model[sound])))


def finding(
    data: Residuals, columns: Sequence[int], variance: Float64[np.ndarray, " P"], nothing: "Weighed"
) -> Finding:
    """Of the hypothesis that adds 1 to the prior variance of its columns; `nothing`: that nothing is missing.

    The noise is learnt anew: what an effect does that nobody allows for is taken for noise, just where it matters.
    """
    wider = variance.copy()
    wider[list(columns)] += 1.0
    found = weighed(data, wider, nothing.temper)
    covariance = np.linalg.inv(found.fit.forms.A.sum(0) / nothing.temper + np.diag(1 / wider))
    own = list(columns)
    return Finding(found.log_evidence - nothing.log_evidence, found.fit.theta[own], covariance[np.ix_(own, own)])


class Weighed(NamedTuple):
    """A prior's fit, and the logarithm of its evidence (Laplace's approximation), likelihoods tempered."""

    fit: Fit
    temper: float
    log_evidence: float


def weighed(data: Residuals, variance: Float64[np.ndarray, " P"], temper: float) -> Weighed:
    """The evidence for a prior around 0."""
    fit = fitted(data, variance)
    precision = fit.forms.A.sum(0) / temper + np.diag(1 / variance)
    occam = np.log(variance).sum() + np.linalg.slogdet(precision)[1]
    evidence = fit.log_likelihood.sum() / temper - 0.5 * ((fit.theta**2 / variance).sum() + occam)
    return Weighed(fit, temper, float(evidence))
