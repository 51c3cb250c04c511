"""Solid under a surface that is seen from above.

No camera sees the underside of an object on a table, so it is inferred. The solid is held as two height maps, its top
and its underside: the top is measured, the underside follows from one assumption, `Underside`.
"""

from dataclasses import dataclass
from typing import Literal, TypeAlias, final

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64, Int

from app.core.types import Cloud

Underside: TypeAlias = Literal["round", "flat", "thin"]
"""Assumption on the underside. `round`: the cross-section is as round below as above, as of a rope or a bean.
`flat`: solid down to the table. `thin`: the surface alone, as of a cloth, with nothing to fill."""
Cells: TypeAlias = Int[np.ndarray, "M 2"]
"""Row and column of the cell under each point."""
Map: TypeAlias = Float32[np.ndarray, "rows columns"]
"""A number for each cell of a square grid on the table: rows along x, columns along y."""

CELL_M = 0.001
"""Edge of a grid cell: less than a pixel of a 640 x 480 camera at 0.75 m (1.2 mm), so the grid loses nothing."""
_SMOOTHING_CELLS = 1.5
"""Standard deviation of the Gaussian over the heights: averages about 30 readings of a view in each cell."""
_GAP_CELLS = 7
"""Gaps in the outline narrower than this lie between samples, or are dropouts, and are closed."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Solid:
    """The space between `underside` and `top` [m, world z] over each cell; both are equal where there is nothing.

    `corner [m] (2,)`: x, y of the middle of the cell (0, 0).
    """

    corner: Float64[np.ndarray, "2"]
    underside: Map
    top: Map

    @property
    def volume_m3(self) -> float:
        """Its volume [m^3]."""
        return float(np.sum(self.top - self.underside, dtype=np.float64)) * CELL_M**2


def fill(surface: Cloud, *, table_m: float, half_width_m: float, underside: Underside) -> Solid:
    """The solid under `surface`, standing on the table at the height `table_m`.

    A round object is symmetric about the plane at half its height, where it is widest. The crest is the highest point
    within `half_width_m`: a point of the top at the height h above the table has its mirror image at crest - h.
    """
    reach = round(half_width_m / CELL_M)
    corner = surface[:, :2].min(axis=0).astype(np.float64) - reach * CELL_M
    cells = np.rint((surface[:, :2] - corner) / CELL_M).astype(np.intp)
    row, column = cells.max(axis=0)
    heights = np.maximum(surface[:, 2] - np.float32(table_m), 0)

    outline = _outline(cells, (int(row) + 1 + reach, int(column) + 1 + reach))
    top = _smooth(cells, heights, outline)
    bottom = np.zeros_like(top)
    if underside == "round":
        # The sides below the widest line are seen too, and are not part of the top.
        upper = heights >= _crest(top, reach)[cells[:, 0], cells[:, 1]] / 2
        top = _smooth(cells[upper], heights[upper], outline)
        bottom = np.minimum(_crest(top, reach) - top, top)
    return Solid(corner=corner, underside=bottom + np.float32(table_m), top=top + np.float32(table_m))


def points_inside(solid: Solid, spacing_m: float) -> Cloud:
    """Points throughout the solid, one for each `spacing_m`^3 of it, in columns that stand `spacing_m` apart."""
    rows, columns = (np.arange(0, size - 0.5, spacing_m / CELL_M) for size in solid.top.shape)
    plan = np.stack(np.meshgrid(rows, columns, indexing="ij"), axis=-1).reshape(-1, 2)
    row, column = np.rint(plan).astype(np.intp).T
    low, high = solid.underside[row, column], solid.top[row, column]
    # The remainder of a column carries over to the next one, so that thin parts get their share.
    count = np.diff(np.rint(np.cumsum(high - low, dtype=np.float64) / spacing_m), prepend=0).astype(np.intp)
    column_of = np.repeat(np.arange(len(plan)), count)
    level = np.arange(len(column_of)) - np.repeat(np.cumsum(count) - count, count)
    share = (level + 0.5) / count[column_of]
    z = low[column_of] + share * (high - low)[column_of]
    xy = solid.corner + plan[column_of] * CELL_M
    return np.concatenate([xy, z[:, None]], axis=1).astype(np.float32)


def _outline(cells: Cells, shape: tuple[int, int]) -> Bool[np.ndarray, "rows columns"]:
    """The cells that hold points, and the small gaps among them."""
    occupied = np.zeros(shape, np.uint8)
    occupied[cells[:, 0], cells[:, 1]] = 1
    return cv2.morphologyEx(occupied, cv2.MORPH_CLOSE, _disc(_GAP_CELLS // 2)).astype(bool)


def _smooth(cells: Cells, heights: Float32[np.ndarray, " M"], outline: Bool[np.ndarray, "rows columns"]) -> Map:
    """The Gaussian-weighted mean height of the points about each cell of the outline; 0 outside."""
    cell = np.ravel_multi_index((cells[:, 0], cells[:, 1]), outline.shape)
    sums = (np.bincount(cell, each, outline.size).astype(np.float32) for each in (np.ones_like(heights), heights))
    weight, height = (cv2.GaussianBlur(each.reshape(outline.shape), (0, 0), _SMOOTHING_CELLS) for each in sums)
    covered = outline & (weight > np.finfo(np.float32).eps)
    return np.divide(height, weight, out=np.zeros_like(height), where=covered)


def _crest(top: Map, reach: int) -> Map:
    """The greatest height within `reach` cells."""
    return cv2.dilate(top, _disc(reach))


def _disc(radius: int) -> np.ndarray:
    return cv2.getStructuringElement(cv2.MORPH_ELLIPSE, (2 * radius + 1, 2 * radius + 1))
