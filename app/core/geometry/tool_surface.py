"""The tool's shape and position from points of its surface, of which cameras may see any part.

Seen from above a tool is every point within its radius of a core: a point for a round tool, a line for a flat one, as
in `shapes.tools.Finger`. The mean of the visible points is on the side that faces the cameras, far from its
middle.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import hypot, pi
from typing import Any, Final, TypeAlias, cast, final

import numpy as np
from jaxtyping import Float64
from scipy.optimize import least_squares
from threadpoolctl import ThreadpoolController

from app.core.types import Cloud

_Plane: TypeAlias = Float64[np.ndarray, "M 2"]

_BLAS = ThreadpoolController()
_NOISE_M: Final = 1e-3
_LEAST_POINTS: Final = 8
_MOST_VIEWS, _MOST_POINTS = 12, 80
_RADII_M: Final = 1e-3, 0.05
_CERTAIN: Final = 0.12
"""Standard deviation of a size, as a share of it, beyond which the points do not say it."""
_BLURRED: Final = 0.3
"""Deviations from a circle, as a share of its radius, beyond which the points are about the tip, and no surface."""
_INSIDE: Final = 0.1
"""Share of a normal cloud within half of its root mean square: 0.22; of an arc or a line seen in one view, less."""
_EVEN: Final = 0.6
"""Ratio of the smaller to the larger width above which a cloud is as wide in all directions."""
_LONG: Final = 1.4
"""Ratio of width to thickness from which a tool is flat, and of the errors of a round to a flat fit."""
_AS_GOOD: Final = 1.3
"""Ratio of costs of fits up to which they are as good."""
_KNOWN_M: Final = 5e-4
"""A middle whose standard deviation is larger is not known."""
_SCALE: Final = 1e-3
_TURN_SCALE: Final = 0.1
_MOST_STEPS: Final = 60
_RIDGE: Final = 1e-3
"""Regularisation that keeps directions without data from having infinite variance."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ToolView:
    """Points of a tool's surface (M, 3) at one moment, and its tip (3,) by the kinematics [m]."""

    points: Cloud
    tip: Float64[np.ndarray, "3"]


@final
@dataclass(frozen=True, kw_only=True)
class ToolShape:
    """Radius, half of the whole width, and yaw of the width from the x axis; None where the points do not determine it.

    A flat tool's radius is half of its thickness; a round one's width is twice its radius, and its yaw 0. `beside_m`:
    offset of the tool's middle from the tip of the kinematics, in the median over views.
    """

    radius_m: float | None
    half_length_m: float | None
    yaw_rad: float | None = 0.0
    flat: bool = False
    beside_m: tuple[float, float] = (0.0, 0.0)
    radius_sd_m: float = 0.0


@_BLAS.wrap(limits=1, user_api="blas")
def fit_tool(views: Sequence[ToolView], *, flat: bool | None = None) -> ToolShape | None:
    """The shape that all views agree on; None where the points show no surface.

    The tool's middle is free in each view: late images and bent arms move it, which does not affect its size. `flat`:
    given where the shape is known to be flat or round.
    """
    chosen = [_level(view) for view in views if len(view.points) >= _LEAST_POINTS]
    if not chosen:
        return None
    chosen = [chosen[k] for k in np.unique(np.linspace(0, len(chosen) - 1, _MOST_VIEWS).round().astype(int))]
    round_ = _Fit.of(chosen, flat=False)
    if round_.error_m > _BLURRED * round_.radius_m and _is_blob(chosen):
        return None
    if flat is False:
        return round_.shape()
    wide = _Fit.of(chosen, flat=True)
    is_flat = wide.half_width_m > (_LONG - 1) * wide.radius_m and (
        round_.error_m > _LONG * wide.error_m or round_.radius_m > _RADII_M[1] / 2
    )
    return wide.shape() if flat or is_flat else round_.shape()


def middle_of(
    view: ToolView, radius_m: float, half_m: tuple[float, float] = (0.0, 0.0)
) -> Float64[np.ndarray, "2"] | None:
    """Middle of a tool of known size [m], seen from above; None where the points do not say it.

    `half_m`: from its middle to an end of its core (`Finger.half_m`).
    """
    if len(view.points) < _LEAST_POINTS:
        return None
    points, half = _level(view), np.array(half_m)
    starts = [np.zeros(2), _circle(points)[:2], points.mean(0)]

    def residuals(middle: Float64[np.ndarray, "2"]) -> Float64[np.ndarray, " M"]:
        return _from_core(points - middle, half)[1] - radius_m

    fits = [least_squares(residuals, start, loss="soft_l1", f_scale=_NOISE_M, x_scale=_SCALE) for start in starts]
    best = fits[int(np.argmin([fit.cost for fit in fits]))]
    # A face alone does not tell from which side it is seen: the kinematics do, roughly.
    chosen = fits[0] if fits[0].cost < _AS_GOOD * best.cost else best
    stiffness = np.linalg.eigvalsh(chosen.jac.T @ chosen.jac)[0]
    if _KNOWN_M * np.sqrt(max(stiffness, 0.0)) < _NOISE_M:
        return None
    return chosen.x + view.tip[:2]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _Fit:
    """A tool fitted to all views at once."""

    radius_m: float
    half_width_m: float
    yaw_rad: float
    error_m: float
    deviation: Float64[np.ndarray, "3"]
    """Standard deviations of radius, half width and yaw."""
    middles: Float64[np.ndarray, "V 2"]

    @classmethod
    def of(cls, views: Sequence[_Plane], *, flat: bool) -> "_Fit":
        """Best fit of several starts: the other side of a line, or of a short arc, is a local minimum of its own."""
        return min(
            (cls._from(views, start, flat=flat) for start in _starts(views, flat=flat)), key=lambda it: it.error_m
        )

    @classmethod
    def _from(cls, views: Sequence[_Plane], start: Float64[np.ndarray, " P"], *, flat: bool) -> "_Fit":
        own, which = (3 if flat else 1), np.repeat(np.arange(len(views)), [len(points) for points in views])
        points, rows = np.concatenate(views), np.arange(sum(map(len, views)))

        def half_of(x: Float64[np.ndarray, " P"]) -> Float64[np.ndarray, "2"]:
            return x[1] * np.array([np.cos(x[2]), np.sin(x[2])]) if flat else np.zeros(2)

        def residuals(x: Float64[np.ndarray, " P"]) -> Float64[np.ndarray, " M"]:
            return _from_core(points - x[own:].reshape(-1, 2)[which], half_of(x))[1] - x[0]

        def slopes(x: Float64[np.ndarray, " P"]) -> Float64[np.ndarray, "M P"]:
            share, distance, out = _from_core(points - x[own:].reshape(-1, 2)[which], half_of(x))
            n = out / np.maximum(distance, 1e-9)[:, None]
            J = np.zeros((len(points), len(x)))
            J[:, 0] = -1.0
            if flat:
                along = np.array([np.cos(x[2]), np.sin(x[2])])
                J[:, 1] = -share * (n @ along)
                J[:, 2] = -share * x[1] * (n @ np.array([-along[1], along[0]]))
            J[rows, own + 2 * which], J[rows, own + 2 * which + 1] = -n[:, 0], -n[:, 1]
            return J

        scale, low, high = np.full(len(start), _SCALE), np.full(len(start), -np.inf), np.full(len(start), np.inf)
        low[0], high[0] = _RADII_M
        if flat:
            scale[2], low[1], high[1] = _TURN_SCALE, 0.0, _RADII_M[1]
        found = least_squares(
            residuals,
            np.clip(start, low + 1e-6, high - 1e-6),
            cast(Any, slopes),  # SciPy's stubs know of strings alone.
            loss="soft_l1",
            f_scale=_NOISE_M,
            x_scale=scale,
            bounds=(low, high),
            max_nfev=_MOST_STEPS,
        )
        error = float(np.sqrt(np.mean(np.minimum(found.fun**2, (5 * _NOISE_M) ** 2))))
        J = slopes(found.x) * scale / max(error, _NOISE_M / 4)
        covariance = np.linalg.inv(J.T @ J + _RIDGE * np.eye(len(scale))) * np.outer(scale, scale)
        deviation = np.zeros(3)
        deviation[:own] = np.sqrt(np.diag(covariance))[:own]
        radius, width, yaw = found.x[:3].tolist() if flat else (float(found.x[0]), 0.0, 0.0)
        return cls(
            radius_m=radius,
            half_width_m=width,
            yaw_rad=(yaw + pi / 2) % pi - pi / 2,
            error_m=error,
            deviation=deviation,
            middles=found.x[own:].reshape(-1, 2),
        )

    def shape(self) -> ToolShape | None:
        """Shape as far as the points determine it; None where they are too far from any such shape."""
        if self.error_m > max(3 * _NOISE_M, _BLURRED * self.radius_m):
            return None
        inside = _RADII_M[0] * 1.01 < self.radius_m < _RADII_M[1] * 0.99
        half = self.half_width_m + self.radius_m
        x, y = np.median(self.middles, axis=0).tolist()
        return ToolShape(
            radius_m=self.radius_m if inside and self.deviation[0] < _CERTAIN * self.radius_m else None,
            half_length_m=half if self.deviation[1] < _CERTAIN * half else None,
            yaw_rad=self.yaw_rad if self.deviation[2] < _CERTAIN else None,
            flat=self.half_width_m > 0,
            beside_m=(x, y),
            radius_sd_m=float(self.deviation[0]),
        )


def _level(view: ToolView) -> _Plane:
    """Points relative to the tip, seen from above; a subset where there are many."""
    points = (view.points.astype(np.float64) - view.tip)[:, :2]
    return points[np.linspace(0, len(points) - 1, min(len(points), _MOST_POINTS)).round().astype(int)]


def _is_blob(views: Sequence[_Plane]) -> bool:
    """True where points scatter about their mean evenly in all directions, and thickly in the middle of it."""
    out = np.concatenate([points - points.mean(0) for points in views])
    distance = np.linalg.norm(out, axis=1)
    widths = np.linalg.svd(out, compute_uv=False)
    return bool(np.mean(distance < 0.5 * np.sqrt(np.mean(distance**2))) > _INSIDE and widths[1] > _EVEN * widths[0])


def _starts(views: Sequence[_Plane], *, flat: bool) -> list[Float64[np.ndarray, " P"]]:
    circles = np.array([_circle(points) for points in views])
    radius = float(np.clip(np.median(circles[:, 2]), 2 * _RADII_M[0], _RADII_M[1] / 3))
    means = np.array([points.mean(0) for points in views])
    if not flat:
        return [np.array([radius, *middles.ravel()]) for middles in (circles[:, :2], np.zeros_like(means))]
    out = np.concatenate([points - mean for points, mean in zip(views, means, strict=True)])
    along = np.linalg.svd(out, full_matrices=False)[2][0]
    yaw = float(np.arctan2(along[1], along[0]))
    half = float(np.quantile(np.abs(out @ along), 0.95))
    thick = max(float(np.quantile(np.abs(out @ np.array([-along[1], along[0]])), 0.95)), 2 * _RADII_M[0])
    radius = min(thick, half / 2)
    side = np.array([-along[1], along[0]])
    return [
        np.array([radius, half - radius, yaw, *(means + shift * radius * side).ravel()]) for shift in (-1.0, 0.0, 1.0)
    ]


def _circle(points: _Plane) -> Float64[np.ndarray, "3"]:
    """Middle and radius of the algebraic circle through points (Kasa 1976), which is small where the arc is short."""
    rows = np.concatenate([2 * points, np.ones((len(points), 1))], axis=1)
    x, y, c = np.linalg.lstsq(rows, (points**2).sum(1), rcond=None)[0].tolist()
    return np.array([x, y, float(np.sqrt(max(c + hypot(x, y) ** 2, _RADII_M[0] ** 2)))])


def _from_core(
    points: _Plane, half: Float64[np.ndarray, "2"]
) -> tuple[Float64[np.ndarray, " M"], Float64[np.ndarray, " M"], _Plane]:
    """Nearest point of a line from -half to half, as a share of it, and distance and vector [m] from there."""
    length = float(half @ half)
    share = np.clip(points @ half / length, -1.0, 1.0) if length > 0 else np.zeros(len(points))
    out = points - share[:, None] * half
    return share, np.linalg.norm(out, axis=1), out
