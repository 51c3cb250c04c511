"""View diagnostics, for tuning colours and judging extrinsics: the object in each view before there are particles."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Bool, Float32
from scipy.spatial import KDTree

from app.core.colours import Mask

Some: TypeAlias = Float32[np.ndarray, "_ 3"]
"""Any number of points [m]."""

_WIDTH = 320
"""Width [pixel] of a thinned mask, as shown in the console."""
_FEWEST = 30
"""Fewest points of a view that locate the object in it."""
_ASKED, _KNOWN = 200, 1500
"""Points of a view, and of the others, that are compared: more would take longer and give the same."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ViewDiagnostics:
    """Diagnostics of one camera's view: the object's mask, thinned, its pixel count, and its points in the box.

    `apart_m`: median distance of its points to the other views', NaN where there is nothing to compare.
    """

    camera: str
    mask: Bool[np.ndarray, "rows columns"]
    pixels: int
    points: int
    apart_m: float


def thin_out(mask: Mask) -> Bool[np.ndarray, "rows columns"]:
    """Every n-th pixel of a mask, so that about 320 are left across."""
    step = max(mask.shape[1] // _WIDTH, 1)
    return np.ascontiguousarray(mask[::step, ::step])


def apart_m(clouds: Sequence[Some]) -> list[float]:
    """Median distance [m] of each cloud's points to the others' nearest; NaN without enough of either.

    Views of one object share only the parts that both see, so it is not zero for well calibrated cameras: about 2 mm
    for a rope seen from two sides. A camera that is 6 mm too high makes it 5 mm.
    """
    few = [_thin(cloud, _KNOWN) for cloud in clouds]
    trees = [KDTree(cloud) if len(cloud) >= _FEWEST else None for cloud in few]
    return [_away_m(cloud, [tree for tree in trees if tree is not own]) for cloud, own in zip(few, trees, strict=True)]


def _away_m(cloud: Some, others: Sequence[KDTree | None]) -> float:
    known = [other for other in others if other is not None]
    if len(cloud) < _FEWEST or not known:
        return float("nan")
    points = _thin(cloud, _ASKED)
    return float(np.median(np.min([other.query(points)[0] for other in known], axis=0)))


def _thin(cloud: Some, count: int) -> Some:
    return cloud[:: max(len(cloud) // count, 1)]
