"""Length and radius of a rope that lies on a table, from clouds of it, for data that do not give them.

The table is at z = 0. Clouds may fill the rope, as reconstructions do, or show the surface that cameras see.
"""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Final, final

import numpy as np
from jaxtyping import Float64
from scipy.optimize import least_squares
from threadpoolctl import ThreadpoolController

from app.core.types import Cloud
from app.sim.rods.geometry.arc_length import arclength_labels, centreline_weights
from app.sim.rods.geometry.centreline import SMOOTHING, through, weigh_points
from app.sim.rods.geometry.orders import shortest_orders
from app.sim.rods.geometry.polyline import lengths, places, resample_polyline, turns
from app.sim.rods.geometry.rope_cloud import RopeShape

_BLAS = ThreadpoolController()
_FEWEST: Final = 30
"""Points of a cloud that say where each part of a rope is."""
_MOST_CLOUDS: Final = 12
_MOST_POINTS: Final = 450
_ORDER_NODES: Final = 24
_SPACING_RADII, _SPOT_RADII = 1.25, 1.6
_SPACING_M, _SPOT_M = 0.008, 0.010
"""Least distances of nodes and spots, of thin ropes: lines through finer ones go zigzag from point to point."""
_NODES: Final = 11, 129
"""Least and most nodes of a centreline, as of a rod."""
_ROUNDS: Final = 6
_SMOOTHING: Final = 2.0
"""Weight of squared second differences (`centreline.SMOOTHING`) in a line whose length counts. With less it goes zigzag
between points beside the middle, and is 2 to 4 % longer than a surface that is seen at 0.5 to 1.8 mm; with more, and
here still of ropes that are folded, it cuts bends. So lengths are those of the straighter half of clouds."""
_TRIMMED: Final = 0.01
"""Share of points beyond either place from which the length is extrapolated: noise moves the very last ones outward."""
_SHORTER: Final = 0.85
"""Length of a cloud, in those of the longer quarter, below which it is folded on itself: seen as one strand, a hairpin
would be the straightest of all. Another that is as much longer than these is not of the rope alone."""
_ROUND_END: Final = 0.4
"""Length of a cloud beyond either end of its centreline, in radii: 0 of a rope that is cut off, 2/3 of a round end, 1
of its surface. It is known no better than `_ROUND_END_SD`, and of both ends alike."""
_ROUND_END_SD: Final = 0.5
_MEDIAN_TO_SD: Final = 1.4826
"""Normal numbers' standard deviation over the median of their sizes."""
_TOP: Final = 0.98
"""Share of a rope's points that are lower than about its top."""
_FULL: Final = 0.65
_POINT_NOISE_M: Final = 1e-3
_ARC_SD, _NOISE_SD = 0.12, 0.45
"""Errors of the radius of a circle through points of a surface, as shares of it and of their noise: how far around
cameras see is not known. Of 24 made-up ropes of 3 to 8 mm, seen to 60 or 90 degrees from above, with up to 1.8 mm."""
_THINNEST_M, _THICKEST_M = 5e-4, 0.05
"""Radii that a rod may have."""
_LEAST_SD_M: Final = 2e-4


@final
@dataclass(frozen=True, kw_only=True)
class RopeSize:
    """Length of the centreline and radius [m], each with its standard deviation."""

    length_m: float
    length_sd_m: float
    radius_m: float
    radius_sd_m: float


@_BLAS.wrap(limits=1, user_api="blas")
def rope_size(clouds: Sequence[Cloud], radius_m: float | None = None) -> RopeSize:
    """The size of a rope of which these are clouds [m], each above the table z = 0.

    `radius_m` where it is known. Raises ValueError where no cloud has enough points.
    """
    usable = [cloud for cloud in clouds if len(cloud) >= _FEWEST]
    if not usable:
        raise ValueError("No cloud has enough points to say how large the rope is.")
    chosen = [usable[k] for k in np.unique(np.linspace(0, len(usable) - 1, _MOST_CLOUDS).round().astype(int))]
    radius, radius_sd = _radius_of(chosen) if radius_m is None else (radius_m, 0.0)
    traces = _unfolded([_trace_line(cloud, radius, _SMOOTHING) for cloud in chosen])
    found = np.array([_without_ends(trace, radius) for trace in traces])
    of_ends = 2 * float(np.hypot(_ROUND_END_SD * radius, _ROUND_END * radius_sd))
    return RopeSize(
        length_m=float(np.median(found)),
        length_sd_m=float(np.hypot(_deviation(found), of_ends)),
        radius_m=radius,
        radius_sd_m=radius_sd,
    )


def length_of_cloud(cloud: Cloud, radius_m: float) -> float:
    """Length [m] of the centreline of a rope of this radius, without its round ends: a bit long, however it is bent."""
    return _without_ends(_trace_line(cloud, radius_m), radius_m)


def _unfolded(traces: Sequence["_Trace"]) -> list["_Trace"]:
    """The straighter half of those that are as long as most of a rope's clouds that do not touch themselves."""
    usual_m = float(np.quantile([trace.length_m for trace in traces], 0.75))
    alike = [trace for trace in traces if _SHORTER * usual_m <= trace.length_m <= usual_m / _SHORTER] or list(traces)
    return sorted(alike, key=lambda trace: trace.bend)[: (len(alike) + 1) // 2]


def _without_ends(trace: "_Trace", radius_m: float) -> float:
    return max(trace.length_m - 2 * _ROUND_END * radius_m, 0.0)


def _radius_of(clouds: Sequence[Cloud]) -> tuple[float, float]:
    """Radius [m] of a rope, the median of its clouds, and its standard deviation."""
    found = np.array([radius_of_cloud(cloud) for cloud in clouds])
    radius, alike = np.median(found, axis=0)
    return float(radius), float(np.hypot(_deviation(found[:, 0]), alike))


def radius_of_cloud(cloud: Cloud) -> tuple[float, float]:
    """Radius [m] of a rope: of an evenly filled tube by the spread of its heights, of a surface by a circle through it.

    Beside it the standard deviation that its clouds have in common. A full disc's top is nearly as far over its median
    height as its side is beside it, that of a surface a third.
    """
    height = cloud[:, 2].astype(np.float64)
    top = float(np.quantile(height, _TOP))
    about_m = max(top / 2, _THINNEST_M)
    beside = _trace_line(cloud, about_m).beside(cloud)
    if top - float(np.median(height)) > _FULL * float(np.quantile(beside, _TOP)):
        return max(2 * float(np.std(height)), _THINNEST_M), 0.0

    def from_circle(circle: Float64[np.ndarray, "2"]) -> Float64[np.ndarray, " N"]:
        return np.hypot(beside, height - circle[0]) - circle[1]

    found = least_squares(
        from_circle,
        np.array([about_m, about_m]),
        loss="soft_l1",
        f_scale=_POINT_NOISE_M,
    )
    radius = float(np.clip(found.x[1], _THINNEST_M, _THICKEST_M))
    noise_m = _MEDIAN_TO_SD * float(np.median(np.abs(from_circle(found.x))))
    return radius, float(np.hypot(_ARC_SD * radius, _NOISE_SD * noise_m))


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class _Trace:
    """A centreline [m], and the length that its cloud has from end to end."""

    line: Float64[np.ndarray, "n 2"]
    length_m: float

    @property
    def bend(self) -> float:
        """Sum of its squared turns [rad^2], in proportion to its energy."""
        return float(np.square(turns(self.line[None])).sum()) * (len(self.line) - 1) / max(self.length_m, _LEAST_SD_M)

    def beside(self, cloud: Cloud) -> Float64[np.ndarray, " N"]:
        """Distances of points from the line, seen from above [m]."""
        at = cloud[:, :2].astype(np.float64)
        return np.sqrt(places(self.line[None], at, _beyond(self.line, _THICKEST_M))[1][0])


def _trace_line(cloud: Cloud, radius_m: float, smoothing: float = SMOOTHING) -> _Trace:
    """The line through the points in the order of the shortest path along them."""
    few = cloud if len(cloud) <= _MOST_POINTS else cloud[:: len(cloud) // _MOST_POINTS + 1]
    nodes = centreline_weights(arclength_labels(few), _ORDER_NODES) @ few
    guess_m = float(np.linalg.norm(np.diff(nodes[:, :2], axis=0), axis=1).sum()) * _ORDER_NODES / (_ORDER_NODES - 1)
    count = int(np.clip(round(guess_m / max(_SPACING_RADII * radius_m, _SPACING_M)), *_NODES))
    about = weigh_points(few, RopeShape(count=count, rest_m=guess_m / (count - 1), radius_m=radius_m))
    most = min(_NODES[1], len(few) // 2)
    spots = int(np.clip(round(guess_m / max(_SPOT_RADII * radius_m, _SPOT_M)), _NODES[0], most))
    line = resample_polyline(shortest_orders(about.at, about.weight, spots, radius_m, 1)[0], count)
    for _ in range(_ROUNDS):
        along = places(line[None], about.at, _beyond(line, radius_m))[0]
        share = (along - along.min()) / max(float(np.ptp(along)), 1e-9)
        line = resample_polyline(through(share * (count - 1), about, count, smoothing)[0], count)
    segment_m = float(lengths(line[None])[0]) / (count - 1)
    along = places(line[None], about.at, _beyond(line, radius_m))[0]
    length_m = segment_m * float(np.diff(np.quantile(along, [_TRIMMED, 1 - _TRIMMED]))[0]) / (1 - 2 * _TRIMMED)
    return _Trace(line=line + about.origin, length_m=length_m)


def _beyond(line: Float64[np.ndarray, "n 2"], radius_m: float) -> float:
    """Length in which points may lie beyond either end of a line, in its segments: two radii."""
    return 2 * radius_m / max(float(lengths(line[None])[0]), radius_m) * (len(line) - 1)


def _deviation(values: Float64[np.ndarray, " K"]) -> float:
    """Standard deviation of the median, by the median's own deviations."""
    spread = _MEDIAN_TO_SD * float(np.median(np.abs(values - np.median(values))))
    return float(max(spread / np.sqrt(len(values)), _LEAST_SD_M))
