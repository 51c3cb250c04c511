"""Motion of occluded parts of the object: the tool pushes them ahead of itself.

Geometry alone, over the last step only: points inside the tool's outline move in the tool's direction until they are
outside, and the points within the object's own width of them move along. The bending of a rope farther away and the
rolling of beans are not modelled; `dipac bench unseen_pushes` measures the gain all the same.
"""

from itertools import pairwise

import numpy as np
from jaxtyping import Float32, Float64

from app.core.geometry.shapes.outlines import Outline
from app.core.geometry.shapes.tools import Tool
from app.core.types import ToolPath

_STEP_M = 0.003
"""Step of the tool: less than half a paddle's thickness, so that it passes through nothing."""
_STILL_M = 1e-6

Surface = Float32[np.ndarray, "R 3"]
Plan = Float64[np.ndarray, "2"]
"""A place or vector seen from above [m]."""


def carry_along(points: Surface, tool: Tool, way: ToolPath, width_m: float) -> Surface:
    """Positions [m, world] of `points` of an object of this width after the tool's path; unchanged without contact.

    A tool without an outline holds, and does not push.
    """
    moved = points.astype(np.float64)
    for begin, end in pairwise(way):
        count = int(np.ceil(np.linalg.norm(end[:2] - begin[:2]) / _STEP_M))
        for share in np.arange(1, count + 1) / max(count, 1):
            at = begin + share * (end - begin)
            outline = tool.outline(at)
            if outline is None:
                return points
            _push(moved, outline, at[:2], end[:2] - begin[:2], width_m)
    return moved.astype(np.float32)


def _push(points: Float64[np.ndarray, "R 3"], outline: Outline, middle: Plan, ahead: Plan, width_m: float) -> None:
    """Move the `points` in direction `ahead` out of the tool at `middle`, with the points near them."""
    length_m = np.linalg.norm(ahead)
    if length_m < _STILL_M:
        return
    ahead = ahead / length_m
    away = points[:, :2] - middle
    beside = (np.linalg.norm(away, axis=1) < outline.extent_m + width_m) & (points[:, 2] > outline.bottom_m)
    beside = np.flatnonzero(beside)
    deep = outline.exit_m(away[beside], ahead)
    inside = deep > 0
    if not inside.any():
        return
    # Points behind the tool stay there.
    front = beside[away[beside] @ ahead > -outline.half_extent_m(ahead)]
    gaps = np.linalg.norm(points[front, None, :2] - points[beside[inside], :2], axis=2)
    points[front, :2] += np.where(gaps < width_m, deep[inside], 0.0).max(axis=1)[:, None] * ahead
