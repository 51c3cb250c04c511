"""Parameters of the simulator from transitions, by gradient on the one-step Chamfer distance (paper, calibration).

The loss is a sum over transitions of non-negative terms, so its gradient by transition gives more than a direction:
with r_k = sqrt(loss_k) as residuals, a damped Gauss-Newton step (Levenberg 1944, Marquardt 1963) gets in a few
evaluations where plain descent takes dozens. Noise leaves a floor under every loss_k, and near it those residuals say
little about curvature; the steps allow for it, and the intervals take it from differences of gradients instead.

A tenth of the transitions makes a third to a half of the summed loss: pushes that the simulator predicts wholly wrong,
whatever its parameters. Huber's loss (Huber 1964) keeps them from deciding the fit; on other pushes of the same world
the fitted model is then better in the plain mean, too (docs/decisions/0004-robust-calibration.md).
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple, final

import numpy as np
from jaxtyping import Float64
from scipy.stats import qmc, t

from app.calibration.quadratics import fit_quadratics
from app.core.errors import SimulationError
from app.sim.parameter import ParameterSpec

Vector = Float64[np.ndarray, " Q"]
Slopes = Callable[[Vector], tuple[Float64[np.ndarray, " K"], Float64[np.ndarray, "K Q"]]]
"""Parameter values -> the loss of each transition [m^2] and its gradient; Q parameters, K transitions."""

_ONE_SIDED = 0.95
"""Ends of a 90 % interval."""
_OUTLYING = 1.5
"""Huber threshold, in medians of the residuals, above which they count linearly."""
_FLOOR_STRETCH = 2.0
"""Largest factor by which a residual's slope is raised once the noise's share of the loss is removed."""
_PROBE = 0.25
"""Step of a coordinate for curvature: a quarter in a logarithm. Shorter ones measure the noise of contact. On other
scales it is a typical value, where there is one."""
_ASIDE = 1.6
"""Distance of the outermost probes, in such steps."""
_FLAT_M2 = 1e-9
"""Least curvature that counts: half of it is the loss [m^2] that a factor e would cost."""
_STEEPEST = 30.0
"""Largest slope of a residual, in medians; steeper ones are clipped to it."""
_SMALLEST_M = 1e-5
"""Least residual [m], a hundredth of a millimetre; smaller ones are raised to it, as the root has no slope at zero."""


@final
@dataclass(frozen=True, kw_only=True)
class FitSettings:
    """Settings of a fit: `steps` trial steps at most, each a factor `max_factor` at most (on a logarithmic scale).

    `trust_factor`: prior standard deviation of the start on a logarithmic scale. Infinite for an arbitrary start;
    finite where a few new transitions refine a model in use. Without `probes` intervals are from slopes and curvature
    at the estimate, which is quick, and often much too wide.
    """

    steps: int = 25
    trust_factor: float = float("inf")
    max_factor: float = 2.5
    damping: float = 0.03
    tolerance: float = 0.01
    probes: int = 0
    """Points about the estimate at which losses are evaluated for its intervals."""


class Tried(NamedTuple):
    """Values of a trial, and its mean loss [m^2]; NaN where nothing could be predicted with them."""

    values: Vector
    loss_m2: float


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Fit:
    """The best values with their 90 % intervals, and every trial on the way, from the start, better or not."""

    values: Vector
    low: Vector
    high: Vector
    loss_m2: float
    trials: tuple[Tried, ...]
    lost: tuple[int, ...]
    """Indices of the transitions that these values do not predict; they are left out."""
    losses_m2: Float64[np.ndarray, " K"]
    """Loss of each transition [m^2]; NaN for those that are lost."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _Point:
    """A point in coordinates u of even steps, with residuals r (K,) [m] and their slopes J (K, Q).

    K are the transitions that are predicted there; the indices of the others are `lost`.
    """

    u: Vector
    lost: tuple[int, ...]
    r: Float64[np.ndarray, " K"]
    J: Float64[np.ndarray, "K Q"]

    @property
    def loss_m2(self) -> float:
        return float((self.r**2).mean())

    @property
    def gradients(self) -> Float64[np.ndarray, "K Q"]:
        """Gradient of each transition's loss, by coordinate [m^2]."""
        return 2 * self.r[:, None] * self.J


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _Objective:
    """Objective of the fit: Huber's loss of the residuals, linear above `threshold_m`, plus a prior at the start.

    The prior is `trust` [m^2] per squared unit of distance from `start`, against the summed losses.
    """

    start: Vector
    trust: float
    threshold_m: float

    def total(self, point: _Point) -> float:
        """Value of the objective [m^2]."""
        beyond = np.maximum(point.r - self.threshold_m, 0)
        return float((point.r**2 - beyond**2).sum() + self.trust * ((point.u - self.start) ** 2).sum())

    def weights(self, point: _Point) -> Float64[np.ndarray, " K"]:
        """Weights of the residuals with which least squares has the same gradient."""
        return np.minimum(1, self.threshold_m / point.r)


def fit(slopes: Slopes, start: Vector, specs: Sequence[ParameterSpec], settings: FitSettings) -> Fit:
    """Descend from `start` within the parameters' ranges; transitions whose prediction is non-finite are left out.

    Raises SimulationError where no transition can be predicted at `start`.
    """
    here = _evaluate(slopes, _coordinates(start, specs), specs)
    if here is None:
        raise SimulationError(
            "The model predicts none of the transitions; start from the nominal model, or record shorter motions."
        )
    trust = here.loss_m2 / np.log(settings.trust_factor) ** 2
    here, trials = _descend(slopes, here, trust, specs, settings)
    if settings.probes and len(here.r) > len(here.u):
        quadratics = fit_quadratics(*_probe_losses(slopes, here, specs, settings.probes))
        weights = np.minimum(1, _OUTLYING * np.median(here.r) / here.r)
        deviation = quadratics.deviation(weights) * _reach(specs)
    else:
        deviation = _deviation(slopes, here, specs)
    factor = _margin(len(here.r), len(here.u))
    margin = factor * deviation if np.isfinite(factor) else np.full(len(here.u), np.inf)
    return Fit(
        values=_values(here.u, specs),
        low=_values(_clip(here.u - margin, specs), specs),
        high=_values(_clip(here.u + margin, specs), specs),
        loss_m2=here.loss_m2,
        trials=(Tried(start, trials[0].loss_m2), *trials[1:]),
        lost=here.lost,
        losses_m2=_insert_lost(here.r**2, here.lost),
    )


def _descend(
    slopes: Slopes, start: _Point, trust: float, specs: Sequence[ParameterSpec], settings: FitSettings
) -> tuple[_Point, list[Tried]]:
    """The best point of at most `steps` trials from `start`, and all of them, beginning with it."""
    here, damping, trials = start, settings.damping, [Tried(_values(start.u, specs), start.loss_m2)]
    for _ in range(settings.steps):
        objective = _Objective(start=start.u, trust=trust, threshold_m=_OUTLYING * float(np.median(here.r)))
        step = _newton_step(here, objective, damping, specs)
        there = _clip(here.u + np.clip(step, -np.log(settings.max_factor), np.log(settings.max_factor)), specs)
        length = float(np.abs(there - here.u).max())
        if length < settings.tolerance / 10:
            break
        trial = _evaluate(slopes, there, specs)
        trials.append(Tried(_values(there, specs), trial.loss_m2 if trial else float("nan")))
        if trial is not None and len(trial.r) >= len(here.r) and objective.total(trial) < objective.total(here):
            here, damping = trial, damping / 3
            if length < settings.tolerance and damping < settings.damping:
                break
        else:
            damping = damping * 10
    return here, trials


def _probe_losses(
    slopes: Slopes, here: _Point, specs: Sequence[ParameterSpec], count: int
) -> tuple[Float64[np.ndarray, "M Q"], Float64[np.ndarray, "M K"], Float64[np.ndarray, "M K Q"]]:
    """Points about the estimate in units of `_reach`, and losses and their gradients [m^2] there.

    Points at which a transition is lost that is not lost at the estimate are left out.
    """
    reach, points = _reach(specs), list[_Point]()
    for z in 2 * qmc.Halton(len(specs), rng=np.random.default_rng(0)).random(count) - 1:
        point = _evaluate(slopes, _clip(here.u + z * reach, specs), specs)
        if point is not None and point.lost == here.lost:
            points.append(point)
    points = points or [here]
    at = np.stack([(point.u - here.u) / reach for point in points])
    return at, np.stack([point.r**2 for point in points]), np.stack([point.gradients * reach for point in points])


def _reach(specs: Sequence[ParameterSpec]) -> Vector:
    """Distance of the outermost probes along each coordinate."""
    return np.array([_ASIDE * _probe(spec) for spec in specs])


def _probe(spec: ParameterSpec) -> float:
    """Probe step of a coordinate: see `_PROBE`."""
    return (
        _PROBE
        if spec.scale == "log" or spec.typical is None
        else abs(spec.typical - spec.nominal) / (spec.high - spec.low)
    )


def _insert_lost(losses: Float64[np.ndarray, " K"], lost: Sequence[int]) -> Float64[np.ndarray, " L"]:
    """The losses with NaN inserted at the indices `lost`."""
    every = np.full(len(losses) + len(lost), np.nan)
    every[np.setdiff1d(np.arange(len(every)), lost)] = losses
    return every


def _evaluate(slopes: Slopes, u: Vector, specs: Sequence[ParameterSpec]) -> _Point | None:
    """The residuals at `u`, of the transitions that stay finite."""
    values = _values(u, specs)
    losses, gradients = slopes(values)
    finite = np.isfinite(losses) & np.isfinite(gradients).all(1)
    if not finite.any():
        return None
    r = np.sqrt(np.maximum(np.asarray(losses, np.float64)[finite], _SMALLEST_M**2))
    per_coordinate = np.array(
        [v if spec.scale == "log" else spec.high - spec.low for v, spec in zip(values, specs, strict=True)]
    )
    J = _credible(np.asarray(gradients, np.float64)[finite] * per_coordinate / (2 * r[:, None]))
    return _Point(u=u, lost=tuple(np.flatnonzero(~finite).tolist()), r=r, J=J)


def _credible(J: Float64[np.ndarray, "K Q"]) -> Float64[np.ndarray, "K Q"]:
    """Slopes, with those far steeper than the others' shortened.

    Some contacts have a million times the usual slope, and would stop every step.
    """
    steep = np.linalg.norm(J, axis=1)
    most = _STEEPEST * np.median(steep)
    return J * np.minimum(1, most / np.maximum(steep, np.finfo(float).tiny))[:, None] if most > 0 else J


def _newton_step(here: _Point, objective: _Objective, damping: float, specs: Sequence[ParameterSpec]) -> Vector:
    """Step that minimises |r + J step|^2, weighted and with the prior, + damping |J|^2 |step|^2.

    The least loss stands for the noise floor, without which the residuals near it are steeper than their roots
    indicate. A coordinate at an end of its range that would leave it stays there, and the others step without it
    (Bertsekas 1982, "Projected Newton Methods for Optimization Problems with Simple Constraints").
    """
    weights = objective.weights(here)
    signal = np.sqrt(here.r**2 - (here.r**2).min())
    stretch = here.r / np.maximum(signal, here.r / _FLOOR_STRETCH)
    J = (np.sqrt(weights) * stretch)[:, None] * here.J
    normal = J.T @ J
    ridge = objective.trust + damping * (np.trace(normal) + _SMALLEST_M**2)
    slope = here.J.T @ (weights * here.r) + objective.trust * (here.u - objective.start)
    low, high = _ends(specs)
    free = ~(((here.u <= low) & (slope > 0)) | ((here.u >= high) & (slope < 0)))
    step = np.zeros(len(slope))
    step[free] = -np.linalg.solve((normal + ridge * np.eye(len(slope)))[np.ix_(free, free)], slope[free])
    return step


def _margin(count: int, free: int) -> float:
    """Standard deviations from an estimate to the ends of its 90 % interval; infinite for too few transitions.

    Student's t, with the correction HC1 of MacKinnon and White 1985 for residuals that a fit of `free` parameters has
    made smaller.
    """
    left = count - free
    return float(t.ppf(_ONE_SIDED, left)) * np.sqrt(count / left) if left > 0 else np.inf


def _deviation(slopes: Slopes, here: _Point, specs: Sequence[ParameterSpec]) -> Vector:
    """Standard deviations of the coordinates: the infinitesimal jackknife over transitions (Jaeckel 1972).

    The variation of the mean gradient with the choice of transitions, through the inverse of the loss's curvature,
    which is at least that of Gauss and Newton. Infinite for a single transition, and wide where the loss is flat.
    """
    count = len(here.r)
    if count < 2:
        return np.full(len(here.u), np.inf)
    curvature = np.stack([_curvature_along(slopes, here, specs, axis) for axis in range(len(here.u))])
    values, vectors = np.linalg.eigh((curvature + curvature.T) / 2)
    least = 2 / count * ((here.J @ vectors) ** 2).sum(0)
    inverse = vectors @ np.diag(1 / np.maximum(np.maximum(values, least), _FLAT_M2)) @ vectors.T
    spread = np.cov(here.gradients.T).reshape(len(here.u), -1) / count
    return np.sqrt(np.diag(inverse @ spread @ inverse))


def _curvature_along(slopes: Slopes, here: _Point, specs: Sequence[ParameterSpec], axis: int) -> Vector:
    """The change of the mean gradient by a step along one coordinate, away from the nearer end of its range."""
    low, high = _ends(specs)
    size = _probe(specs[axis])
    step = size if high[axis] - here.u[axis] > here.u[axis] - low[axis] else -size
    there = _evaluate(slopes, here.u + step * np.eye(len(specs))[axis], specs)
    if there is None:
        return np.zeros(len(specs))
    return (there.gradients.mean(0) - here.gradients.mean(0)) / step


def _coordinates(values: Vector, specs: Sequence[ParameterSpec]) -> Vector:
    pairs = zip(values, specs, strict=True)
    return np.array([np.log(v) if s.scale == "log" else v / (s.high - s.low) for v, s in pairs], np.float64)


def _values(u: Vector, specs: Sequence[ParameterSpec]) -> Vector:
    pairs = zip(u, specs, strict=True)
    return np.array([np.exp(c) if s.scale == "log" else c * (s.high - s.low) for c, s in pairs], np.float64)


def _ends(specs: Sequence[ParameterSpec]) -> tuple[Vector, Vector]:
    low = _coordinates(np.array([spec.low for spec in specs]), specs)
    high = _coordinates(np.array([spec.high for spec in specs]), specs)
    return low, high


def _clip(u: Vector, specs: Sequence[ParameterSpec]) -> Vector:
    return np.clip(u, *_ends(specs))
