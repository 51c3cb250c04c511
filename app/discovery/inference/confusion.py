"""Confusion of causes by these very pushes: causes hidden in their linear model, and screened for.

The noise, the priors of everything that may be a little wrong besides, and the slopes are those of the screening. The
evidence of a cause is then its score, with all else integrated out, which is normal: hundreds of hidden causes cost as
much as one (a parametric bootstrap; Davison and Hinkley 1997, "Bootstrap Methods and their Application", chapter 4).
"""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np
from jaxtyping import Float64

from app.discovery.inference.decide import likeliest_cause
from app.discovery.inference.screen import Screening
from app.discovery.inference.weighing import log_bayes_of
from app.discovery.residuals.forces import FORMULA
from app.discovery.residuals.sensitivity import hypotheses_of

_DRAWS = 200
_LEAST = 1e-12
"""Floor of eigenvalues of the information, relative to the largest: below it, pushes are uninformative."""


class _Design(NamedTuple):
    """Information of the pushes on every column, and a square root of it."""

    information: Float64[np.ndarray, "P P"]
    root: Float64[np.ndarray, "P P"]


def confusions(screening: Screening, causes: Sequence[str], seed: int = 0) -> Float64[np.ndarray, "C C"]:
    """Confusion matrix of `causes` at typical size: rates at which each is named as each; the rest is another or none.

    A cause that has a place is hidden at one of those that the screening asked about.
    """
    rng, groups, known = np.random.default_rng(seed), _groups(screening), _design(screening)
    names = list(groups)
    found = np.zeros((len(causes), len(causes)))
    for row, cause in enumerate(causes):
        scores = np.stack([_score(rng, screening, known, groups[cause]) for _ in range(_DRAWS)])
        logs = [_best(scores, known, groups[name]) for name in names]
        taken = [likeliest_cause(dict(zip(names, draw.tolist(), strict=True))) for draw in np.array(logs).T]
        found[row] = [taken.count(other) / _DRAWS for other in causes]
    return found


def _groups(screening: Screening) -> dict[str, list[list[int]]]:
    """The columns of each cause, once for each place or way that was asked about."""
    steps, nuisance = screening.steps, screening.prior.nuisance
    found = dict[str, list[list[int]]]()
    for (cause, _), columns in hypotheses_of(
        steps, (n for n in range(len(steps)) if n not in nuisance and steps[n].cause != FORMULA)
    ).items():
        found.setdefault(cause, []).append(columns)
    return found


def _design(screening: Screening) -> _Design:
    """Information on all columns, with each column's own prior integrated out."""
    weighing, weights = screening.weighing, 1 / screening.prior.variance
    A = weighing.nothing.forms.A.sum(0) / weighing.temperature
    information = np.diag(weights) - weights[:, None] * np.linalg.inv(A + np.diag(weights)) * weights
    values, vectors = np.linalg.eigh((information + information.T) / 2)
    kept = np.maximum(values, _LEAST * max(float(values.max()), _LEAST))
    return _Design((vectors * kept) @ vectors.T, vectors * np.sqrt(kept))


def _best(
    scores: Float64[np.ndarray, "D P"], known: _Design, ways: Sequence[Sequence[int]]
) -> Float64[np.ndarray, " D"]:
    """The largest logarithmic Bayes factor of a cause's ways."""
    return np.max([log_bayes_of(scores, known.information, columns) for columns in ways], axis=0)


def _score(
    rng: np.random.Generator, screening: Screening, known: _Design, ways: Sequence[Sequence[int]]
) -> Float64[np.ndarray, " P"]:
    """Random scores of all columns, with the cause at its typical size in a random direction."""
    own = list(ways[int(rng.integers(len(ways)))])
    size = rng.normal(size=len(own))
    size /= np.linalg.norm(size)
    one_sided = [screening.steps[column].sides == 1 for column in own]
    hidden = np.zeros(len(known.information))
    hidden[own] = np.where(one_sided, np.abs(size), size)
    return known.information @ hidden + known.root @ rng.normal(size=len(hidden))
