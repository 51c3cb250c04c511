"""What each view shows of the object before there are particles: for whoever tunes colours and judges extrinsics."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Bool, Float32
from scipy.spatial import KDTree

from app.core.colours import Mask

Some: TypeAlias = Float32[np.ndarray, "_ 3"]
"""So many points as there are [m]."""

_WIDTH = 320
"""Of a thinned mask: what the console shows of an image."""
_FEWEST = 30
"""Points fewer than these say too little of where a view sees the object."""
_ASKED, _KNOWN = 200, 1500
"""So many points of a view are compared with so many of the others: more would take longer and say the same."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Look:
    """One camera's view: the pixels taken for the object, thinned, and how many of all; its points in the box.

    `apart_m`: half of the points are nearer to the other views' than this, NaN where there is nothing to compare.
    """

    camera: str
    mask: Bool[np.ndarray, "rows columns"]
    pixels: int
    points: int
    apart_m: float


def thinned(mask: Mask) -> Bool[np.ndarray, "rows columns"]:
    """One pixel of each few, so that about 320 are left across."""
    step = max(mask.shape[1] // _WIDTH, 1)
    return np.ascontiguousarray(mask[::step, ::step])


def apart_m(clouds: Sequence[Some]) -> list[float]:
    """For each cloud the median distance [m] of its points to the others' nearest; NaN without enough of either.

    Views of one object share only what both see, so it is not zero for cameras that stand right: about 2 mm for a rope
    seen from two sides. A camera that is 6 mm too high makes it 5 mm.
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
