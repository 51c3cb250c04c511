"""Robust bundle adjustment of the two ends of the chain, in the presence of wrong views.

Residuals are whitened view by view: corner errors are independent, an error of the gripper's pose moves all corners of
a view together. The part of a view's residual beyond corner noise is its pose error, which weights the view as a whole
(Cauchy's weights), since a view whose pose is wrong is wrong in every corner. scipy's losses weight each residual by
itself.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, NamedTuple, final

import numpy as np
from jaxtyping import Bool, Float64

from app.core.geometry.hand_eye import Setup
from app.core.geometry.lens import Lens
from app.core.types import Transform
from app.perception.calibration.chain import JOINTS_M, JOINTS_RAD, PIXEL_PX, Ends, residuals, slopes, whiten

_ROUNDS = 30
_STILL = 1e-9
"""Step length [rad, m] below which the iteration has converged."""
_CAUCHY = 2.0
"""Error, in typical errors, at which half of the weight is left. 2.385 is usual for one number; a view has six."""
_TYPICAL: Final = float(np.sqrt(5.348))
"""The median length of six standard normal numbers: that of chi-squared with six degrees of freedom is 5.348."""
_OUTLIER: Final = 5.0
"""Outlier threshold: six standard normal numbers are longer once in 3000 views."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Corners:
    """Data of one view for the chain: the robot's side, points on the board [m], and their images [pixel]."""

    H: Transform
    points: Float64[np.ndarray, "C 3"]
    pixels: Float64[np.ndarray, "C 2"]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Refined:
    """The refined ends, and the residuals of each view.

    `covariance (12, 12)`: of `ends`, in the order of their Jacobian. By view: `kept` or an outlier, root mean square
    reprojection error `error_px`, and the error of the gripper's pose that would explain it, `turn_rad (V, 3)` and
    `shift_m (V, 3)`.
    """

    ends: Ends
    covariance: Float64[np.ndarray, "12 12"]
    kept: Bool[np.ndarray, " V"]
    error_px: Float64[np.ndarray, " V"]
    turn_rad: Float64[np.ndarray, "V 3"]
    shift_m: Float64[np.ndarray, "V 3"]


def refine(begun: Ends, views: Sequence[Corners], lens: Lens, setup: Setup) -> Refined:
    """Refine `begun`, first with robust weights on every view, then with the inliers alone."""
    chain = _Chain(views, lens, setup)
    doubted = _descend(begun, chain, np.ones(len(views), bool), doubting=True)
    lengths = chain.lengths(doubted)
    kept = lengths < _OUTLIER * _scale(lengths)
    ends = _descend(doubted, chain, kept, doubting=False)
    told = chain.equations(ends)
    return Refined(
        ends=ends,
        covariance=_covariance(told, kept),
        kept=kept,
        error_px=np.array([each.error_px for each in told]),
        turn_rad=np.array([each.pose_error[:3] for each in told]),
        shift_m=np.array([each.pose_error[3:] for each in told]),
    )


def information(ends: Ends, view: Corners, lens: Lens, setup: Setup) -> Float64[np.ndarray, "12 12"]:
    """Information matrix of the ends from one view: J' S^-1 J, with S the covariance of its residuals."""
    J, by_H = slopes(ends, view.H, view.points, lens, setup)
    return J.T @ whiten(by_H, J)


@final
class _Told(NamedTuple):
    """Linearisation of one view at given ends.

    Its part of the normal equations, its cost, and its pose error [rad, m] with its length in standard deviations.
    """

    N: Float64[np.ndarray, "12 12"]
    g: Float64[np.ndarray, "12"]
    cost: float
    error_px: float
    pose_error: Float64[np.ndarray, "6"]
    length: float


@final
class _Chain(NamedTuple):
    """All views of a chain."""

    views: Sequence[Corners]
    lens: Lens
    setup: Setup

    def equations(self, ends: Ends) -> list[_Told]:
        return [self._of(ends, view) for view in self.views]

    def lengths(self, ends: Ends) -> Float64[np.ndarray, " V"]:
        return np.array([each.length for each in self.equations(ends)])

    def _of(self, ends: Ends, view: Corners) -> _Told:
        J, by_H = slopes(ends, view.H, view.points, self.lens, self.setup)
        r = residuals(ends, view.H, view.points, view.pixels, self.lens)
        white = whiten(by_H, np.concatenate([J, r[:, None]], axis=1))
        error, length = _pose_error(by_H, r)
        return _Told(
            N=J.T @ white[:, :12],
            g=J.T @ white[:, 12],
            cost=float(r @ white[:, 12]),
            error_px=float(np.sqrt(2 * np.mean(r**2))),
            pose_error=error,
            length=length,
        )


def _pose_error(
    by_H: Float64[np.ndarray, "R 6"], r: Float64[np.ndarray, " R"]
) -> tuple[Float64[np.ndarray, "6"], float]:
    """The error of the gripper's pose [rad, m] that would explain residuals, and its length in its deviations."""
    N = by_H.T @ by_H
    error = -np.linalg.solve(N, by_H.T @ r)
    spread = np.diag([JOINTS_RAD**2] * 3 + [JOINTS_M**2] * 3) + PIXEL_PX**2 * np.linalg.inv(N)
    return error, float(np.sqrt(error @ np.linalg.solve(spread, error)))


def _descend(begun: Ends, chain: _Chain, kept: Bool[np.ndarray, " V"], *, doubting: bool) -> Ends:
    """Gauss-Newton descent with Levenberg damping where a step raises the cost, views reweighted at each step."""
    ends, told, brake = begun, chain.equations(begun), 1e-6
    for _ in range(_ROUNDS):
        weights = kept * (_weights(np.array([each.length for each in told])) if doubting else 1.0)
        N = np.tensordot(weights, [each.N for each in told], 1)
        step = -np.linalg.solve(N + brake * np.diag(np.diag(N)), np.tensordot(weights, [each.g for each in told], 1))
        tried = chain.equations(ends.shift(step))
        if not _cost(tried, weights) <= _cost(told, weights):
            brake *= 10.0
            continue
        ends, told, brake = ends.shift(step), tried, max(brake / 10.0, 1e-12)
        if np.abs(step).max() < _STILL:
            break
    return ends


def _cost(told: Sequence[_Told], weights: Float64[np.ndarray, " V"]) -> float:
    return float(sum(weight * each.cost for weight, each in zip(weights, told, strict=True)))


def _scale(lengths: Float64[np.ndarray, " V"]) -> float:
    """Ratio of actual to assumed errors, at least 1."""
    return max(1.0, float(np.median(lengths)) / _TYPICAL)


def _weights(lengths: Float64[np.ndarray, " V"]) -> Float64[np.ndarray, " V"]:
    return 1.0 / (1.0 + (lengths / (_CAUCHY * _TYPICAL * _scale(lengths))) ** 2)


def _covariance(told: Sequence[_Told], kept: Bool[np.ndarray, " V"]) -> Float64[np.ndarray, "12 12"]:
    """Covariance of the ends: that of the assumed noise, scaled by the ratio of actual to assumed errors.

    The factor is the reduced chi-squared of the views' pose errors, six numbers a view less the twelve that were
    fitted, and no less than 1.
    """
    counted = [each for each, keep in zip(told, kept, strict=True) if keep]
    freedom = max(6 * len(counted) - 12, 1)
    larger = max(1.0, sum(each.length**2 for each in counted) / freedom)
    return np.linalg.inv(np.sum([each.N for each in counted], axis=0)) * larger
