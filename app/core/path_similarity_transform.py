"""Similarity transform of a tool path by its end points."""

from typing import Final

import numpy as np
from jaxtyping import Float64

from app.core.types import Path3

_APART_M: Final = 1e-3
"""End points nearer than this [m] do not define a rotation and scale."""


def reshape(way: Path3, start: Float64[np.ndarray, "3"], end: Float64[np.ndarray, "3"]) -> Path3:
    """`way` (W, 3) [m] moved, turned and scaled in the table's plane so that it goes from `start` to `end` [m].

    Heights are unchanged. A path that ends where it begins keeps its shape and follows `start` alone.
    """
    z = way[:, 0] + 1j * way[:, 1]
    first, last = complex(start[0], start[1]), complex(end[0], end[1])
    span = z[-1] - z[0]
    turned = (last - first) / span if abs(span) > _APART_M else 1.0
    made = first + (z - z[0]) * turned
    return np.column_stack([made.real, made.imag, way[:, 2]])


def is_level(way: Path3) -> bool:
    """True for a path (W, 3) [m] of nonzero length at one height, such as a push over the table."""
    if len(way) < 2 or not np.isfinite(way).all():
        return False
    length_m = np.linalg.norm(np.diff(way[:, :2], axis=0), axis=1).sum()
    return bool(np.ptp(way[:, 2]) < _APART_M < length_m)
