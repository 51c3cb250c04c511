"""Enlargement of the region where two clouds are farthest apart, from above."""

import numpy as np
from jaxtyping import Float64

from app.core.types import Points
from app.report.drawing.chart import Plot, svg
from app.report.drawing.ground import DOTS_DRAWN, Bounds, ground, surface
from app.report.drawing.markup import Markup, tag

LENS_M = 0.035
"""Half the side of the region."""
_WIDTH = 360.0


def lens(seen: Points, predicted: Points) -> Bounds:
    """The square where observed points are farthest from predicted ones."""
    points = _flat(seen)
    distances = _nearest_m(points, _flat(predicted))
    near = np.linalg.norm(points[:, None] - points[None], axis=2) < LENS_M / 2
    x, y = (float(value) for value in points[int(np.argmax(near @ distances / near.sum(1)))])
    return x - LENS_M, x + LENS_M, y - LENS_M, y + LENS_M


def apart_mm(seen: Points, predicted: Points) -> float:
    """Mean distance from an observed point to the nearest predicted one, from above [mm]."""
    return 1e3 * float(_nearest_m(_flat(seen), _flat(predicted)).mean())


def frame(p: Plot, within: Bounds) -> Markup:
    """The region's outline on a larger drawing."""
    x, y = p.at((within[0], within[3]))
    return tag("rect", x=x, y=y, width=p.x(within[1]) - x, height=p.y(within[2]) - y, class_="lens")


def close_up(within: Bounds) -> Plot:
    """The plot of the region."""
    return ground(within, _WIDTH)


def enlarge(
    p: Plot, ident: str, title: str, description: str, drawn: Markup, axes: tuple[str, str] = ("x [m]", "y [m]")
) -> Markup:
    """A drawing of the region, clipped at its edges; `ident` is unique on the page."""
    inside = tag("rect", x=p.x.start, y=p.y.end, width=p.x.end - p.x.start, height=p.y.start - p.y.end)
    return svg(
        p.width,
        p.height,
        title,
        description,
        tag("clipPath", inside, id=ident),
        surface(p, *axes),
        tag("g", drawn, clip_path=f"url(#{ident})", class_="close"),
    )


def _nearest_m(points: Float64[np.ndarray, "M 2"], others: Float64[np.ndarray, "K 2"]) -> Float64[np.ndarray, " M"]:
    return np.linalg.norm(points[:, None] - others[None], axis=2).min(1)


def _flat(points: Points) -> Float64[np.ndarray, "M 2"]:
    """At most `DOTS_DRAWN` of the points, from above."""
    step = max(1, -(-len(points) // DOTS_DRAWN))
    return points[::step, :2].astype(np.float64)
