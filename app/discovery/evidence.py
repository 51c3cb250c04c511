"""What the pushes say of all parameters together: residuals, slopes, and a noise that is learnt from both.

Residuals of clouds are amplitudes of displacement modes; their covariance is the same for all pushes but for its size.
Most pushes are predicted to a millimetre, and a few, where the object slips off the tool or not, by nothing: a
multivariate Student t (Lange, Little and Taylor 1989, "Robust statistical modeling using the t distribution"), wider
where a disturbed start already ends elsewhere. What was measured directly has independent errors of one size a kind: a
covariance that is free would take a delay for noise of the arm's log.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias, final

import numpy as np
from jaxtyping import Bool, Float64, Int

_DEGREES = 2.0
_ROUNDS = 25
_LEAST_ROUNDS = 3
_SHRINK = 16.0
"""Pushes' worth of a diagonal covariance that is added to the learnt one."""
_LEAST_M = 1e-4
_SETTLED = 2e-3
"""Steps."""

Covariances: TypeAlias = tuple[Float64[np.ndarray, "_ _"], ...]
"""Of each block of rows [m^2], for a push of usual size."""


class Block(NamedTuple):
    """Rows whose errors belong together. `least_m` [m]: they are independent and no smaller; None: all is learnt."""

    rows: slice
    least_m: float | None = None


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
    blocks: tuple[Block, ...]

    def __len__(self) -> int:
        return len(self.r)

    def without(self, episode: int) -> "Residuals":
        """All episodes but one."""
        return self.of(self.episode != episode)

    def of(self, chosen: Bool[np.ndarray, " K"] | Int[np.ndarray, " L"]) -> "Residuals":
        """Some of the pushes."""
        return Residuals(
            r=self.r[chosen],
            J=self.J[chosen],
            spread=self.spread[chosen],
            known=self.known[chosen],
            episode=self.episode[chosen],
            blocks=self.blocks,
        )


class Forms(NamedTuple):
    """-2 log likelihood of each episode at theta, to second order: c - 2 b theta + theta A theta, but for c."""

    A: Float64[np.ndarray, "E P P"]
    b: Float64[np.ndarray, "E P"]
    episode: Int[np.ndarray, " E"]


class Fit(NamedTuple):
    """The most probable theta, the noise about it, the likelihood's forms there, and its logarithm."""

    theta: Float64[np.ndarray, " P"]
    covariances: Covariances
    forms: Forms
    log_likelihood: float


class _Rows(NamedTuple):
    """The rows of one block, of the pushes in which something of it was seen; 0 where nothing was."""

    r: Float64[np.ndarray, "K S"]
    J: Float64[np.ndarray, "K S P"]
    spread: Float64[np.ndarray, "K S D"]
    known: Bool[np.ndarray, "K S"]
    seen: Float64[np.ndarray, " K"]
    episode: Int[np.ndarray, " K"]
    least_m: float | None

    def left(self, theta: Float64[np.ndarray, " P"]) -> Float64[np.ndarray, "K S"]:
        return (self.r - self.J @ theta) * self.known


def fitted(
    data: Residuals,
    variance: Float64[np.ndarray, " P"],
    mean: Float64[np.ndarray, " P"] | None = None,
    starts: Sequence[Covariances | None] = (None,),
) -> Fit:
    """Theta under a normal prior, and the covariance that makes what is left most likely, in turns.

    The likelihood has more than one maximum: noise can pass for an effect's work. The best from all `starts` is taken.
    """
    blocks, centre = _blocks(data), np.zeros(len(variance)) if mean is None else mean
    found = [_climbed(blocks, variance, centre, start) for start in starts]
    return max(found, key=lambda fit: fit.log_likelihood - 0.5 * float(((fit.theta - centre) ** 2 / variance).sum()))


def log_likelihood(data: Residuals, theta: Float64[np.ndarray, " P"], covariances: Covariances) -> float:
    """Of all pushes under a noise that is known, but for a constant."""
    rows = zip(_blocks(data), covariances, strict=True)
    return float(sum(_log_likelihood(block, _root(covariance), theta) for block, covariance in rows))


def _blocks(data: Residuals) -> list[_Rows]:
    found = list[_Rows]()
    for rows, least in data.blocks:
        use = data.known[:, rows].any(1)
        known = data.known[use, rows]
        found.append(
            _Rows(
                r=data.r[use, rows] * known,
                J=data.J[use, rows] * known[:, :, None],
                spread=data.spread[use, rows],
                known=known,
                seen=known.sum(1).astype(np.float64),
                episode=data.episode[use],
                least_m=least,
            )
        )
    return found


def _climbed(
    blocks: Sequence[_Rows],
    variance: Float64[np.ndarray, " P"],
    centre: Float64[np.ndarray, " P"],
    start: Covariances | None,
) -> Fit:
    theta, precision = centre.copy(), np.diag(1 / variance)
    covariances = start or tuple(_first(block) for block in blocks)
    for turn in range(_ROUNDS):
        total, pull = precision.copy(), precision @ centre
        roots = [_root(covariance) for covariance in covariances]
        # Before theta is known at all no push may pass for an outlier.
        size_of = _size if turn else _start
        sizes = [size_of(block, root, theta) for block, root in zip(blocks, roots, strict=True)]
        for block, root, size in zip(blocks, roots, sizes, strict=True):
            WJ, Wr = _whitened(block, root, size)
            flat = WJ.reshape(-1, len(theta))
            total += flat.T @ flat
            pull += flat.T @ Wr.ravel()
        new = np.linalg.solve(total, pull)
        covariances = tuple(_scatter(block, new, size) for block, size in zip(blocks, sizes, strict=True))
        settled = float(np.abs(new - theta).max()) < _SETTLED
        theta = new
        if settled and turn + 1 >= _LEAST_ROUNDS:
            break
    roots = [_root(covariance) for covariance in covariances]
    likelihood = sum(_log_likelihood(block, root, theta) for block, root in zip(blocks, roots, strict=True))
    return Fit(theta, covariances, _forms(blocks, roots, theta), float(likelihood))


def _first(block: _Rows) -> Float64[np.ndarray, "S S"]:
    """A diagonal covariance to begin with: the usual residual of each row."""
    if not len(block.r):
        return np.eye(block.r.shape[1]) * (block.least_m or _LEAST_M) ** 2
    return np.diag(np.median(np.abs(block.r), 0) ** 2 / 0.45 + (block.least_m or _LEAST_M) ** 2)


def _root(covariance: Float64[np.ndarray, "S S"]) -> Float64[np.ndarray, "S S"]:
    """What makes errors of this covariance independent and of unit size."""
    return np.linalg.inv(np.linalg.cholesky(covariance))


def _distances(
    block: _Rows, root: Float64[np.ndarray, "S S"], theta: Float64[np.ndarray, " P"]
) -> tuple[Float64[np.ndarray, " K"], Float64[np.ndarray, " K"]]:
    """The width that each push's start gives it, and Mahalanobis' squared distance of what is left."""
    ends = ((root @ block.spread) ** 2).sum((1, 2))
    start = 1 + ends / np.maximum(block.spread.shape[2] * block.seen, 1)
    return start, ((block.left(theta) @ root.T) ** 2).sum(1) / start


def _start(
    block: _Rows, root: Float64[np.ndarray, "S S"], theta: Float64[np.ndarray, " P"]
) -> Float64[np.ndarray, " K"]:
    return _distances(block, root, theta)[0]


def _size(
    block: _Rows, root: Float64[np.ndarray, "S S"], theta: Float64[np.ndarray, " P"]
) -> Float64[np.ndarray, " K"]:
    """How much wider than usual each push is: because its end depends on its start, and as Student's t weighs it."""
    start, distance = _distances(block, root, theta)
    return start * (_DEGREES + distance) / (_DEGREES + block.seen)


def _log_likelihood(block: _Rows, root: Float64[np.ndarray, "S S"], theta: Float64[np.ndarray, " P"]) -> float:
    start, distance = _distances(block, root, theta)
    volume = -2 * float(np.log(np.diag(root)).sum()) / len(root)
    each = (_DEGREES + block.seen) * np.log1p(distance / _DEGREES) + block.seen * (np.log(start) + volume)
    return -0.5 * float(each.sum())


def _whitened(
    block: _Rows, root: Float64[np.ndarray, "S S"], size: Float64[np.ndarray, " K"]
) -> tuple[Float64[np.ndarray, "K S P"], Float64[np.ndarray, "K S"]]:
    weight = 1 / np.sqrt(size)
    return (root @ block.J) * weight[:, None, None], (block.r @ root.T) * weight[:, None]


def _scatter(
    block: _Rows, theta: Float64[np.ndarray, " P"], size: Float64[np.ndarray, " K"]
) -> Float64[np.ndarray, "S S"]:
    """The covariance of what is left, for a push of usual size; a little of it is taken to be without correlation."""
    rows = block.r.shape[1]
    if not len(block.r):
        return np.eye(rows) * (block.least_m or _LEAST_M) ** 2
    left = block.left(theta)
    if block.least_m is not None:
        one = float((left**2 / size[:, None]).sum() / block.seen.sum())
        return np.eye(rows) * max(one, block.least_m**2)
    seen = np.sqrt(np.maximum(block.known.sum(0), 1))
    raw = (left / size[:, None]).T @ left / np.outer(seen, seen)  # Positive, whatever is missing.
    shrunk = (len(left) * raw + _SHRINK * np.diag(np.diag(raw))) / (len(left) + _SHRINK)
    return shrunk + _LEAST_M**2 * np.eye(rows)


def _forms(
    blocks: Sequence[_Rows], roots: Sequence[Float64[np.ndarray, "_ _"]], theta: Float64[np.ndarray, " P"]
) -> Forms:
    episodes = np.unique(np.concatenate([block.episode for block in blocks]))
    A, b = np.zeros((len(episodes), len(theta), len(theta))), np.zeros((len(episodes), len(theta)))
    for block, root in zip(blocks, roots, strict=True):
        WJ, Wr = _whitened(block, root, _size(block, root, theta))
        for row, episode in enumerate(episodes):
            own = block.episode == episode
            flat = WJ[own].reshape(-1, len(theta))
            A[row] += flat.T @ flat
            b[row] += flat.T @ Wr[own].ravel()
    return Forms(A, b, episodes)
