"""Convex hulls of boxes, capsules and strips, as corners: every part covers the hull of its projected corners."""

import itertools
from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Float64

Corners: TypeAlias = Float64[np.ndarray, "_ 3"]
"""Points [m, world] whose convex hull contains a part."""

_TURNS, _RINGS = 12, 5
_OUTSIDE = 1.06
"""Scale of a ball's polyhedron that makes its inscribed corners enclose the ball."""


def box_corners(
    half_m: Sequence[float], turn: Float64[np.ndarray, "3 3"], middle: Float64[np.ndarray, "3"], margin_m: float
) -> Corners:
    """Corners of a box of these half sides, enlarged by the margin; `turn`: rotation of its axes to the world's."""
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(8, 3)
    return middle + signs * (np.asarray(half_m) + margin_m) @ turn.T


def capsule_corners(begin: Float64[np.ndarray, "3"], end: Float64[np.ndarray, "3"], radius_m: float) -> list[Corners]:
    """Pieces of a capsule between the centres of its round ends."""
    return strip_corners([begin], [end], radius_m)


def strip_corners(
    begin: Sequence[Float64[np.ndarray, "3"]], end: Sequence[Float64[np.ndarray, "3"]], radius_m: float
) -> list[Corners]:
    """Pieces of the volume within a radius of the sweep, no longer than thick: each has a nearest distance."""
    first, last = np.stack(begin), np.stack(end)
    count = max(1, int(np.ceil(np.linalg.norm(last[0] - first[0]) / (2 * radius_m))))
    places = first + np.linspace(0.0, 1.0, count + 1)[:, None, None] * (last - first)
    balls = places[:, :, None] + _OUTSIDE * radius_m * _BALL
    return [np.concatenate([*a, *b]) for a, b in itertools.pairwise(balls)]


def _ball() -> Float64[np.ndarray, "Q 3"]:
    """Points on the unit sphere: rings about the vertical, and the poles."""
    height = np.linspace(-1.0, 1.0, _RINGS + 2)[1:-1]
    around = np.linspace(0.0, 2 * np.pi, _TURNS, endpoint=False)
    z, turn = (each.ravel() for each in np.meshgrid(np.sin(np.pi / 2 * height), around, indexing="ij"))
    rim = np.sqrt(1 - z**2)
    rings = np.stack([rim * np.cos(turn), rim * np.sin(turn), z], axis=1)
    return np.concatenate([rings, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])


_BALL = _ball()
