"""The table seen from above: the robot's x to the right and y up, in metres, one scale for both."""

from collections.abc import Iterable
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from jaxtyping import Float

from app.discovery.results.case import Case
from app.report.drawing.chart import Plot, arrow_path, axes, dots, plot, polyline
from app.report.drawing.markup import Markup, concat, tag

Flat: TypeAlias = Float[np.ndarray, "_ _"]
"""Points, shape (M, 2) or (M, 3), of which the first two columns are x and y [m]; many clouds of many sizes."""
Bounds: TypeAlias = tuple[float, float, float, float]
"""Least and greatest x, least and greatest y [m]."""

DOTS_DRAWN = 400
"""Most points drawn of a cloud: more are a blot, and a large file."""
_MARGIN_M = 0.02
_SNAP_M = 0.02
_SQUARE = 0.75
"""Least ratio of the shorter side to the longer one."""
_MARGINS = (10.0, 10.0, 44.0, 60.0)


def table_bounds(case: Case) -> Bounds:
    """Bounds of every drawing of the whole table: all observed positions."""
    clouds: list[np.ndarray] = [case.arrows.places]
    clouds += [cloud for it in case.examples for cloud in (it.before, it.observed, it.tool)]
    if case.next_push is not None:
        clouds += [case.next_push.before, case.next_push.track.positions]
    return bounds(clouds)


def bounds(clouds: Iterable[Flat], margin_m: float = _MARGIN_M) -> Bounds:
    """A rectangle around clouds, on even numbers."""
    points = np.concatenate([np.zeros((0, 2)), *(np.asarray(cloud)[:, :2] for cloud in clouds)])
    points = points[np.isfinite(points).all(axis=1)]
    if not len(points):
        return 0.28, 0.82, -0.32, 0.32
    low = np.floor((points.min(0) - margin_m) / _SNAP_M) * _SNAP_M
    high = np.ceil((points.max(0) + margin_m) / _SNAP_M) * _SNAP_M
    missing = np.maximum(_SQUARE * (high - low).max() - (high - low), 0.0)
    low, high = low - missing / 2, high + missing / 2
    return float(low[0]), float(high[0]), float(low[1]), float(high[1])


def ground(within: Bounds, width: float, tallest: float = 620.0) -> Plot:
    """Plot of a part of the table, of this width unless it becomes too tall."""
    x_low, x_high, y_low, y_high = within
    top, right, bottom, left = _MARGINS
    scale = min((width - left - right) / (x_high - x_low), (tallest - top - bottom) / (y_high - y_low))
    return plot(
        left + right + scale * (x_high - x_low),
        top + bottom + scale * (y_high - y_low),
        (x_low, x_high),
        (y_low, y_high),
        _MARGINS,
    )


def surface(p: Plot, across: str = "x [m]", up: str = "y [m]") -> Markup:
    """The table top, or a plane upright on it, with its axes."""
    top = tag("rect", x=p.x.start, y=p.y.end, width=p.x.end - p.x.start, height=p.y.start - p.y.end, class_="ground")
    return concat([top, axes(p, across, up, grid="xy")])


def cloud(p: Plot, points: Flat, kind: str) -> Markup:
    """A cloud as dots."""
    finite = points[np.isfinite(points).all(axis=1)]
    kept = finite[:: max(1, -(-len(finite) // DOTS_DRAWN))]
    return dots((p.at(point) for point in kept), kind)


def way(p: Plot, positions: Flat, kind: str = "tool") -> Markup:
    """The tool's path, with an arrow head at its end."""
    pixels = [p.at(point) for point in positions]
    moves = [
        pixels[0],
        *(b for a, b in pairwise(pixels) if np.hypot(b[0] - a[0], b[1] - a[1]) > 0.2),
    ]
    if len(moves) < 2:
        return dots(moves, f"{kind}-start")
    back = moves[-min(len(moves), 8)]
    head = tag("path", d=arrow_path(back, moves[-1], 11.0), class_=kind)
    return concat([polyline(moves, kind), head, dots(moves[:1], f"{kind}-start")])
