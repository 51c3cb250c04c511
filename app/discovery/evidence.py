"""What the pushes say of all parameters together: residuals, slopes, and a noise that is learnt from both.

Residuals are amplitudes of displacement modes; their covariance is the same for all pushes but for its size. Most
pushes are predicted to a millimetre, and a few, where the object slips off the tool or not, by nothing: a multivariate
Student t (Lange, Little and Taylor 1989, "Robust statistical modeling using the t distribution"), wider where a
disturbed start already ends elsewhere.
"""

from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Bool, Float64, Int

_DEGREES = 2.0
_ROUNDS = 40
_SHRINK = 8.0
"""Pushes' worth of a diagonal covariance that is added to the learnt one."""
_LEAST_M = 1e-4
_SETTLED = 1e-3
"""Steps."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Residuals:
    """Of K pushes: residuals (K, R) [m], slopes (K, R, P) [m a step], ends of disturbed starts (K, R, D) [m].

    `known`: what was seen; the rest counts for nothing.
    """

    r: Float64[np.ndarray, "K R"]
    J: Float64[np.ndarray, "K R P"]
    spread: Float64[np.ndarray, "K R D"]
    known: Bool[np.ndarray, "K R"]
    episode: Int[np.ndarray, " K"]

    def __len__(self) -> int:
        return len(self.r)


class Noise(NamedTuple):
    """Covariance (R, R) [m^2] of a push of usual size, and each push's size, as a factor of variance."""

    covariance: Float64[np.ndarray, "R R"]
    size: Float64[np.ndarray, " K"]


class Forms(NamedTuple):
    """-2 log likelihood of each push at theta, to second order: c - 2 b theta + theta A theta."""

    A: Float64[np.ndarray, "K P P"]
    b: Float64[np.ndarray, "K P"]
    c: Float64[np.ndarray, " K"]
    episode: Int[np.ndarray, " K"]

    def by_episode(self) -> "Forms":
        """The sums over each episode."""
        numbers = np.unique(self.episode)
        rows = [self.episode == number for number in numbers]
        A = np.stack([self.A[row].sum(0) for row in rows])
        b = np.stack([self.b[row].sum(0) for row in rows])
        return Forms(A, b, np.array([self.c[row].sum() for row in rows]), numbers)


class Fit(NamedTuple):
    """The most probable theta, the noise about it, forms there, and the log likelihood of each push."""

    theta: Float64[np.ndarray, " P"]
    noise: Noise
    forms: Forms
    log_likelihood: Float64[np.ndarray, " K"]


def fitted(data: Residuals, variance: Float64[np.ndarray, " P"], mean: Float64[np.ndarray, " P"] | None = None) -> Fit:
    """Theta under a normal prior, and the covariance that makes what is left most likely, in turns."""
    centre = np.zeros(len(variance)) if mean is None else mean
    precision = np.diag(1 / variance)
    theta = centre.copy()
    covariance = np.diag(np.median(np.abs(data.r), 0) ** 2 / 0.45 + _LEAST_M**2)
    for _ in range(_ROUNDS):
        size = _sizes(data, covariance, theta)
        forms = _forms(data, covariance, size)
        new = np.linalg.solve(forms.A.sum(0) + precision, forms.b.sum(0) + precision @ centre)
        covariance = _scatter(data, new, size)
        settled = np.abs(new - theta).max() < _SETTLED
        theta = new
        if settled:
            break
    size = _sizes(data, covariance, theta)
    forms = _forms(data, covariance, size)
    return Fit(theta, Noise(covariance, size), forms, _log_likelihoods(data, covariance, theta))


def _left(data: Residuals, theta: Float64[np.ndarray, " P"]) -> Float64[np.ndarray, "K R"]:
    """What theta does not explain; 0 where nothing was seen."""
    return np.where(data.known, data.r - data.J @ theta, 0.0)


def _sizes(
    data: Residuals, covariance: Float64[np.ndarray, "R R"], theta: Float64[np.ndarray, " P"]
) -> Float64[np.ndarray, " K"]:
    """How much wider than usual each push is: because its end depends on its start, and as Student's t weighs it."""
    start, distance, rows = _distances(data, covariance, theta)
    return start * (_DEGREES + distance) / (_DEGREES + rows)


def _log_likelihoods(
    data: Residuals, covariance: Float64[np.ndarray, "R R"], theta: Float64[np.ndarray, " P"]
) -> Float64[np.ndarray, " K"]:
    """Of each push, but for a constant."""
    start, distance, rows = _distances(data, covariance, theta)
    volume = np.linalg.slogdet(covariance)[1] / len(covariance)
    return -0.5 * ((_DEGREES + rows) * np.log1p(distance / _DEGREES) + rows * (np.log(start) + volume))


def _distances(
    data: Residuals, covariance: Float64[np.ndarray, "R R"], theta: Float64[np.ndarray, " P"]
) -> tuple[Float64[np.ndarray, " K"], Float64[np.ndarray, " K"], Float64[np.ndarray, " K"]]:
    """The width that a push's start gives it, Mahalanobis' squared distance of what is left, and its number of rows."""
    inverse, rows = np.linalg.inv(covariance), np.maximum(data.known.sum(1), 1).astype(np.float64)
    left = _left(data, theta)
    start = 1 + np.einsum("krd,rs,ksd->k", data.spread, inverse, data.spread) / (data.spread.shape[2] * rows)
    return start, np.einsum("ki,ij,kj->k", left, inverse, left) / start, rows


def _scatter(
    data: Residuals, theta: Float64[np.ndarray, " P"], size: Float64[np.ndarray, " K"]
) -> Float64[np.ndarray, "R R"]:
    """The covariance of what is left, for a push of usual size; a little of it is taken to be without correlation."""
    left, seen = _left(data, theta), np.sqrt(np.maximum(data.known.sum(0), 1))
    raw = np.einsum("k,ki,kj->ij", 1 / size, left, left) / np.outer(seen, seen)  # Positive, whatever is missing.
    shrunk = (len(data) * raw + _SHRINK * np.diag(np.diag(raw))) / (len(data) + _SHRINK)
    return shrunk + _LEAST_M**2 * np.eye(len(raw))


def _forms(data: Residuals, covariance: Float64[np.ndarray, "R R"], size: Float64[np.ndarray, " K"]) -> Forms:
    inverse = np.linalg.inv(covariance)
    J, r = np.where(data.known[:, :, None], data.J, 0.0), np.where(data.known, data.r, 0.0)
    half = np.einsum("rs,ksp->krp", inverse, J)
    return Forms(
        A=np.einsum("k,krp,krq->kpq", 1 / size, J, half, optimize=True),
        b=np.einsum("k,krp,kr->kp", 1 / size, half, r, optimize=True),
        c=np.einsum("k,ki,ij,kj->k", 1 / size, r, inverse, r),
        episode=data.episode,
    )
