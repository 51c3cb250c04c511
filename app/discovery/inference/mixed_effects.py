"""Mixed-effects regression of all parameters on all pushes: residuals, slopes, and a noise learnt from both.

Residuals of clouds are amplitudes of displacement modes. Their covariance has a part that is the same for all pushes
and is learnt, and one of each push by itself: where a slightly other start, friction or grid already ends elsewhere, a
simulator errs, in just these ways, and otherwise in the next push (random slopes, as in Laird and Ware 1982,
"Random-effects models for longitudinal data"). Without it a few pushes that nearly anything would move say the most of
every cause, and the same wrong thing. Most pushes are predicted to a millimetre, and a few, where the object slips off
the tool or not, by nothing: a multivariate Student t (Lange, Little and Taylor 1989, "Robust statistical modeling using
the t distribution"). What was measured directly has independent errors of one size a kind: a covariance that is free
would take a delay for noise of the arm's log.
"""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from jaxtyping import Bool, Float64, Int
from scipy.linalg import inv

from app.discovery.inference.anderson import AndersonExtrapolation
from app.discovery.residuals.rows import Residuals

_DEGREES = 2.0
_ROUNDS = 100
_FARTHEST = 1.0
"""Most by which the logarithm of a deviation is extrapolated at once."""
_LOSS = 0.1
"""Log likelihood by which an extrapolation may be worse than the best so far: rounds that shrink covariances lose some,
too."""
_SHRINK = 16.0
"""Pushes' worth of a diagonal covariance that is added to the learnt one."""
_LEAST_M = 1e-4
_SETTLED = 2e-4
"""Relative change of a learnt variance, given those before it, in a round. The likelihood would stop too soon: it
turns on its way."""

Covariances: TypeAlias = tuple[Float64[np.ndarray, "_ _"], ...]
"""Covariance of each block of rows [m^2], for a push of usual size."""


class QuadraticForms(NamedTuple):
    """-2 log likelihood of each episode at theta, to second order: c - 2 b theta + theta A theta, but for c."""

    A: Float64[np.ndarray, "E P P"]
    b: Float64[np.ndarray, "E P"]
    episode: Int[np.ndarray, " E"]


class MixedEffectsFit(NamedTuple):
    """The most probable theta, the noise about it, the likelihood's forms there, and its logarithm."""

    theta: Float64[np.ndarray, " P"]
    covariances: Covariances
    forms: QuadraticForms
    log_likelihood: float


class _Rows(NamedTuple):
    """The rows of one block, of the pushes in which something of it was seen; 0 where nothing was.

    `own`: the covariance of what errs in each push by itself [m^2]; of one push where nothing does.
    """

    r: Float64[np.ndarray, "K S"]
    J: Float64[np.ndarray, "K S P"]
    own: Float64[np.ndarray, "_ S S"]
    known: Bool[np.ndarray, "K S"]
    seen: Float64[np.ndarray, " K"]
    episode: Int[np.ndarray, " K"]
    least_m: float | None

    def residuals(self, theta: Float64[np.ndarray, " P"]) -> Float64[np.ndarray, "K S"]:
        return (self.r - self.J @ theta) * self.known


class _Fit(NamedTuple):
    """Theta and the covariances of all blocks. Flat, these are Cholesky factors of logarithmic diagonal."""

    theta: Float64[np.ndarray, " P"]
    covariances: Covariances

    def flatten(self) -> Float64[np.ndarray, " _"]:
        parts = [self.theta]
        for covariance in self.covariances:
            lower = np.linalg.cholesky(covariance)
            scale = np.diag(lower)
            parts += [np.log(scale), (lower / scale[:, None])[np.tril_indices(len(scale), -1)]]
        return np.concatenate(parts)

    def unflatten(self, flat: Float64[np.ndarray, " _"]) -> "_Fit":
        """Another one of the same sizes, from its numbers."""
        theta, rest = np.split(flat, [len(self.theta)])
        covariances = list[Float64[np.ndarray, "S S"]]()
        for rows in map(len, self.covariances):
            scale, below, rest = np.split(rest, [rows, rows * (rows + 1) // 2])
            lower = np.eye(rows)
            lower[np.tril_indices(rows, -1)] = below
            lower *= np.exp(scale)[:, None]
            covariances.append(lower @ lower.T)
        return _Fit(theta, tuple(covariances))

    def logarithms(self) -> Bool[np.ndarray, " _"]:
        """Mask of the numbers that are logarithms of deviations."""
        parts = [np.zeros(len(self.theta), bool)]
        for rows in map(len, self.covariances):
            parts += [np.ones(rows, bool), np.zeros(rows * (rows - 1) // 2, bool)]
        return np.concatenate(parts)


def fit_mixed_effects(
    data: Residuals,
    variance: Float64[np.ndarray, " P"],
    mean: Float64[np.ndarray, " P"] | None = None,
    starts: Sequence[Covariances | None] = (None,),
) -> MixedEffectsFit:
    """Theta under a normal prior, and the residuals' covariance by maximum likelihood, in turns.

    The likelihood has more than one maximum: noise can pass for an effect's work. The best from all `starts` is taken.
    """
    blocks, centre = _blocks(data), np.zeros(len(variance)) if mean is None else mean
    found = [_em_fit(blocks, variance, centre, start) for start in starts]
    return max(found, key=lambda fit: fit.log_likelihood - _misfit(fit.theta, variance, centre))


def log_likelihood(data: Residuals, theta: Float64[np.ndarray, " P"], covariances: Covariances) -> float:
    """Log likelihood of all pushes under a known noise, up to a constant."""
    blocks = _blocks(data)
    return _log_likelihood_of(blocks, _roots_of(blocks, covariances), theta)


def scores(data: Residuals, fit: MixedEffectsFit) -> Float64[np.ndarray, "K P"]:
    """Each push's slope of the log likelihood at the fit, for every column."""
    found = np.zeros((len(data), len(fit.theta)))
    for (rows, *_), block, covariance in zip(data.blocks, _blocks(data), fit.covariances, strict=True):
        root = _roots(block, covariance)
        WJ, Wr = _whiten(block, root, _size(block, root, fit.theta))
        found[data.known[:, rows].any(1)] += np.einsum("ksp,ks->kp", WJ, Wr - WJ @ fit.theta)
    return found


def information_of(data: Residuals, covariances: Covariances) -> Float64[np.ndarray, "K P P"]:
    """Fisher's information that each push has about all columns under a known noise, were it of usual size.

    Residuals do not enter: it is of pushes that were made as of those that might be.
    """
    found = np.zeros((len(data), data.J.shape[2], data.J.shape[2]))
    for (rows, *_), block, covariance in zip(data.blocks, _blocks(data), covariances, strict=True):
        WJ, _ = _whiten(block, _roots(block, covariance), np.ones(len(block.r)))
        found[data.known[:, rows].any(1)] += np.swapaxes(WJ, 1, 2) @ WJ
    return found


def forms_of(data: Residuals, theta: Float64[np.ndarray, " P"], covariances: Covariances) -> QuadraticForms:
    """The likelihood's forms about any theta under a known noise, with the weight that Student's t gives each push."""
    blocks = _blocks(data)
    return _forms(blocks, _roots_of(blocks, covariances), theta)


def _blocks(data: Residuals) -> list[_Rows]:
    found = list[_Rows]()
    for rows, least, _ in data.blocks:
        use = data.known[:, rows].any(1)
        known = data.known[use, rows]
        spread = data.spread[use, rows] * known[:, :, None]
        spread = spread if spread.any() else spread[:1]
        found.append(
            _Rows(
                r=data.r[use, rows] * known,
                J=data.J[use, rows] * known[:, :, None],
                own=spread @ np.swapaxes(spread, 1, 2),
                known=known,
                seen=known.sum(1).astype(np.float64),
                episode=data.episode[use],
                least_m=least,
            )
        )
    return found


def _em_fit(
    blocks: Sequence[_Rows],
    variance: Float64[np.ndarray, " P"],
    centre: Float64[np.ndarray, " P"],
    start: Covariances | None,
) -> MixedEffectsFit:
    """A local maximum of the likelihood: rounds of expectation and maximisation until they change no variance.

    Each begins where the last ones are extrapolated to, if that is no worse (Henderson and Varadhan 2019, "Damped
    Anderson acceleration with restarts and monotonicity control for accelerating EM", without the damping).
    """
    here = _Fit(centre, start or tuple(_first(block) for block in blocks))
    # Before theta is known at all no push may pass for an outlier.
    sizes: list[Float64[np.ndarray, " K"]] | None = [np.ones(len(block.r)) for block in blocks]
    logarithms, path = here.logarithms(), AndersonExtrapolation()
    plain, best = here, -np.inf
    for _ in range(_ROUNDS):
        roots = _roots_of(blocks, here.covariances)
        if sizes is None:
            worth = _log_likelihood_of(blocks, roots, here.theta) - _misfit(here.theta, variance, centre)
            if not worth >= best - _LOSS:
                here, path, best = plain, AndersonExtrapolation(), -np.inf
                continue
            best = max(best, worth)
        plain = _round(blocks, roots, variance, centre, here, sizes)
        flat, reached, sizes = here.flatten(), plain.flatten(), None
        if 2 * np.abs((reached - flat)[logarithms]).max() < _SETTLED:
            break
        ahead = path.after(flat, reached)
        is_near = np.abs((ahead - reached)[logarithms]).max() < _FARTHEST
        here = here.unflatten(ahead) if is_near else plain
    roots = _roots_of(blocks, plain.covariances)
    likelihood = _log_likelihood_of(blocks, roots, plain.theta)
    return MixedEffectsFit(plain.theta, plain.covariances, _forms(blocks, roots, plain.theta), likelihood)


def _misfit(
    theta: Float64[np.ndarray, " P"], variance: Float64[np.ndarray, " P"], centre: Float64[np.ndarray, " P"]
) -> float:
    """Negative logarithm of theta's prior, but for a constant."""
    return 0.5 * float(((theta - centre) ** 2 / variance).sum())


def _log_likelihood_of(
    blocks: Sequence[_Rows], roots: Sequence[Float64[np.ndarray, "_ _ _"]], theta: Float64[np.ndarray, " P"]
) -> float:
    return float(sum(_log_likelihood(block, root, theta) for block, root in zip(blocks, roots, strict=True)))


def _roots_of(blocks: Sequence[_Rows], covariances: Covariances) -> list[Float64[np.ndarray, "_ _ _"]]:
    return [_roots(block, covariance) for block, covariance in zip(blocks, covariances, strict=True)]


def _round(
    blocks: Sequence[_Rows],
    roots: Sequence[Float64[np.ndarray, "_ _ _"]],
    variance: Float64[np.ndarray, " P"],
    centre: Float64[np.ndarray, " P"],
    here: _Fit,
    sizes: Sequence[Float64[np.ndarray, " K"]] | None,
) -> _Fit:
    """Theta under the noise that is known, and the noise about it; `sizes` of pushes, or those of theta so far."""
    if sizes is None:
        sizes = [_size(block, root, here.theta) for block, root in zip(blocks, roots, strict=True)]
    total, pull = np.diag(1 / variance), centre / variance
    for block, root, size in zip(blocks, roots, sizes, strict=True):
        WJ, Wr = _whiten(block, root, size)
        flat = WJ.reshape(-1, len(here.theta))
        total += flat.T @ flat
        pull += flat.T @ Wr.ravel()
    theta = np.linalg.solve(total, pull)
    parts = zip(blocks, here.covariances, roots, sizes, strict=True)
    return _Fit(theta, tuple(_scatter(block, old, root, theta, size) for block, old, root, size in parts))


def _first(block: _Rows) -> Float64[np.ndarray, "S S"]:
    """A diagonal covariance to begin with: the usual residual of each row."""
    if not len(block.r):
        return np.eye(block.r.shape[1]) * (block.least_m or _LEAST_M) ** 2
    return np.diag(np.median(np.abs(block.r), 0) ** 2 / 0.45 + (block.least_m or _LEAST_M) ** 2)


def _roots(block: _Rows, covariance: Float64[np.ndarray, "S S"]) -> Float64[np.ndarray, "_ S S"]:
    """Whitening matrices of each push's errors, the learnt ones and its own; one where they are all the same."""
    return inv(np.linalg.cholesky(covariance + block.own), assume_a="lower triangular", check_finite=False)


def _distances(
    block: _Rows, roots: Float64[np.ndarray, "_ S S"], theta: Float64[np.ndarray, " P"]
) -> Float64[np.ndarray, " K"]:
    """Squared Mahalanobis distance of each push's residuals at theta."""
    return (_times(roots, block.residuals(theta)) ** 2).sum(1)


def _size(
    block: _Rows, roots: Float64[np.ndarray, "_ S S"], theta: Float64[np.ndarray, " P"]
) -> Float64[np.ndarray, " K"]:
    """Scale of each push's errors over the usual one, as in Student's t."""
    return (_DEGREES + _distances(block, roots, theta)) / (_DEGREES + block.seen)


def _log_likelihood(block: _Rows, roots: Float64[np.ndarray, "_ S S"], theta: Float64[np.ndarray, " P"]) -> float:
    volume = -2 * np.log(np.diagonal(roots, axis1=1, axis2=2)).mean(1)
    distance = _distances(block, roots, theta)
    return -0.5 * float(((_DEGREES + block.seen) * np.log1p(distance / _DEGREES) + block.seen * volume).sum())


def _whiten(
    block: _Rows, roots: Float64[np.ndarray, "_ S S"], size: Float64[np.ndarray, " K"]
) -> tuple[Float64[np.ndarray, "K S P"], Float64[np.ndarray, "K S"]]:
    weight = 1 / np.sqrt(size)
    return (roots @ block.J) * weight[:, None, None], _times(roots, block.r) * weight[:, None]


def _times(matrices: Float64[np.ndarray, "_ S S"], vectors: Float64[np.ndarray, "K S"]) -> Float64[np.ndarray, "K S"]:
    return (matrices @ vectors[:, :, None])[:, :, 0]


def _scatter(
    block: _Rows,
    covariance: Float64[np.ndarray, "S S"],
    roots: Float64[np.ndarray, "_ S S"],
    theta: Float64[np.ndarray, " P"],
    size: Float64[np.ndarray, " K"],
) -> Float64[np.ndarray, "S S"]:
    """Common covariance of the residuals, for a push of usual size; shrunk a little towards its diagonal.

    A step of expectation and maximisation from the one before: of what is left, what is expected to be common.
    """
    rows = block.r.shape[1]
    if not len(block.r):
        return np.eye(rows) * (block.least_m or _LEAST_M) ** 2
    left = block.residuals(theta) / np.sqrt(size)[:, None]
    if block.least_m is not None:
        one = float((left**2).sum() / block.seen.sum())
        return np.eye(rows) * max(one, block.least_m**2)
    precisions = np.swapaxes(roots, 1, 2) @ roots
    common = _times(covariance @ precisions, left) * block.known
    seen = np.sqrt(np.maximum(block.known.sum(0), 1))
    # covariance - covariance @ precisions @ covariance, but for the cancellation: positive, whatever is missing.
    unsure = covariance @ (precisions @ block.own).mean(0)
    raw = common.T @ common / np.outer(seen, seen) + (unsure + unsure.T) / 2
    shrunk = (len(left) * raw + _SHRINK * np.diag(np.diag(raw))) / (len(left) + _SHRINK)
    return shrunk + _LEAST_M**2 * np.eye(rows)


def _forms(
    blocks: Sequence[_Rows], roots: Sequence[Float64[np.ndarray, "_ _ _"]], theta: Float64[np.ndarray, " P"]
) -> QuadraticForms:
    episodes = np.unique(np.concatenate([block.episode for block in blocks]))
    A, b = np.zeros((len(episodes), len(theta), len(theta))), np.zeros((len(episodes), len(theta)))
    for block, root in zip(blocks, roots, strict=True):
        WJ, Wr = _whiten(block, root, _size(block, root, theta))
        for row, episode in enumerate(episodes):
            own = block.episode == episode
            flat = WJ[own].reshape(-1, len(theta))
            A[row] += flat.T @ flat
            b[row] += flat.T @ Wr[own].ravel()
    return QuadraticForms(A, b, episodes)
