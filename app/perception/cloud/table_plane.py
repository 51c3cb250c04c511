"""The plane of a table in the frame of its points, and its flatness.

Fitted by Cauchy's loss, to which a hand or an object among the points matters little (Holland and Welsch 1977, "Robust
regression using iteratively reweighted least-squares").
"""

from collections.abc import Sequence
from dataclasses import dataclass
from math import degrees
from typing import Final, final

import numpy as np
from jaxtyping import Bool, Float64
from scipy.optimize import least_squares
from scipy.spatial.transform import Rotation

from app.core.types import Cloud

_LEAST_POINTS: Final = 12
_MOST_POINTS: Final = 3000
_NOISE_M: Final = 2e-3
_ARM_M: Final = 0.3
"""Length over which a slope counts as height."""
_SIDE: Final = 4
_CELL_POINTS: Final = 8
_MEDIAN_TO_SD: Final = 1.4826
_UNEVEN_M: Final = 5e-3
"""Deviation of a sixteenth of a table from its plane that makes it uneven, if it exceeds four standard errors."""
_PATCH_M: Final = 0.05
_LOWEST: Final = 0.05
_WIDE_M: Final = 0.2
"""Extent below which the lowest points do not determine a slope along a direction."""

_Points = Float64[np.ndarray, "M 3"]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class TablePlane:
    """A plane through `middle` [m] with an upward unit `normal`."""

    middle: Float64[np.ndarray, "3"]
    normal: Float64[np.ndarray, "3"]
    noise_m: float = 0.0
    """Standard deviation of the points from the plane."""
    uneven_m: float = 0.0
    """Largest median distance of the points from the plane in any sixteenth of the table."""
    flat: bool = True

    @property
    def height_m(self) -> float:
        """Height of its middle."""
        return float(self.middle[2])

    @property
    def tilt_deg(self) -> float:
        """Angle between its normal and the z axis."""
        return degrees(np.arccos(np.clip(self.normal[2], -1.0, 1.0)))

    @property
    def levelling(self) -> Rotation:
        """The smallest rotation that takes its normal to the z axis: x and y stay the user's."""
        axis = np.cross(self.normal, [0.0, 0.0, 1.0])
        sine = float(np.linalg.norm(axis))
        return Rotation.from_rotvec(axis / sine * np.arcsin(min(sine, 1.0))) if sine > 0 else Rotation.identity()

    def above(self, points: Float64[np.ndarray, "*batch 3"]) -> Float64[np.ndarray, "*batch 3"]:
        """Points in the table's frame [m]: level, at height 0, unchanged over its middle."""
        turned = self.levelling.apply((points - self.middle).reshape(-1, 3)).reshape(points.shape)
        return turned + np.array([*self.middle[:2], 0.0])


def plane_of_points(points: Cloud) -> TablePlane | None:
    """The plane through points of a bare table [m]; None where they are too few."""
    x = points.astype(np.float64)
    if len(x) < _LEAST_POINTS:
        return None
    x = x[np.linspace(0, len(x) - 1, min(len(x), _MOST_POINTS)).round().astype(int)]
    plane, off = _fit(x)
    noise = _MEDIAN_TO_SD * float(np.median(np.abs(off)))
    uneven, sure = _uneven(plane, x, off, noise)
    return TablePlane(
        middle=plane.middle, normal=plane.normal, noise_m=noise, uneven_m=uneven, flat=uneven <= max(_UNEVEN_M, sure)
    )


def plane_of_clouds(clouds: Sequence[Cloud]) -> TablePlane | None:
    """The plane under an object: through the lowest points of its clouds in each patch of the table [m].

    It is level along a direction too narrow for a slope. None where there are no points.
    """
    x = np.concatenate([cloud.astype(np.float64) for cloud in clouds]) if clouds else np.zeros((0, 3))
    if len(x) < _LEAST_POINTS:
        return None
    cells = np.unique(np.floor(x[:, :2] / _PATCH_M).astype(int), axis=0, return_inverse=True)[1].ravel()
    order = np.lexsort((x[:, 2], cells))
    groups = np.split(x[order], np.flatnonzero(np.diff(cells[order])) + 1)
    lowest = np.array([group[int(_LOWEST * len(group))] for group in groups])
    narrow = np.linalg.svd(lowest[:, :2] - lowest[:, :2].mean(0), compute_uv=False)[-1] * 2 / np.sqrt(len(lowest))
    if len(lowest) < _LEAST_POINTS or narrow < _WIDE_M / 2:
        middle = np.array([*x[:, :2].mean(0), np.median(lowest[:, 2])])
        return TablePlane(middle=middle, normal=np.array([0.0, 0.0, 1.0]))
    return _fit(lowest)[0]


def _fit(x: _Points) -> tuple[TablePlane, Float64[np.ndarray, " M"]]:
    """The plane, which is not upright, and each point's height above it."""
    middle = np.median(x, axis=0)
    rows = np.concatenate([(x[:, :2] - middle[:2]) / _ARM_M, np.ones((len(x), 1))], axis=1)
    height = x[:, 2] - middle[2]
    start = np.linalg.lstsq(rows, height, rcond=None)[0]
    for kept in (0.8, 0.6):
        near = _nearest(np.abs(height - rows @ start), kept)
        start = np.linalg.lstsq(rows[near], height[near], rcond=None)[0]

    def residuals(plane: Float64[np.ndarray, "3"]) -> Float64[np.ndarray, " M"]:
        return height - rows @ plane

    found = least_squares(residuals, start, loss="cauchy", f_scale=_NOISE_M).x
    normal = np.array([-found[0] / _ARM_M, -found[1] / _ARM_M, 1.0])
    normal /= np.linalg.norm(normal)
    plane = TablePlane(middle=middle + np.array([0.0, 0.0, found[2]]), normal=normal)
    return plane, (x - plane.middle) @ normal


def _nearest(distance: Float64[np.ndarray, " M"], share: float) -> Bool[np.ndarray, " M"]:
    return distance <= np.quantile(distance, share)


def _uneven(plane: TablePlane, x: _Points, off: Float64[np.ndarray, " M"], noise_m: float) -> tuple[float, float]:
    """The largest median distance from the plane in a cell of four by four, and four standard errors of it [m]."""
    xy = (x - plane.middle)[:, :2]
    low, high = np.quantile(xy, [0.0, 1.0], axis=0)
    at = np.clip(((xy - low) / np.maximum(high - low, 1e-9) * _SIDE).astype(int), 0, _SIDE - 1)
    cells = at[:, 0] * _SIDE + at[:, 1]
    medians = [(abs(float(np.median(off[cells == cell]))), int((cells == cell).sum())) for cell in np.unique(cells)]
    usable = [(size, 4 * noise_m / np.sqrt(count)) for size, count in medians if count >= _CELL_POINTS]
    return max(usable, default=(0.0, 0.0))
