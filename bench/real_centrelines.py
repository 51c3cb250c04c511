"""Centrelines of a real rope's clouds: ropes with tassels, whose points are no equal shares of the length.

`RodState.at_rest` takes the rank of a particle as its place along the rope, which holds for ropes of even thickness.
Here places are found by projection, in turns with the line (Hastie and Stuetzle 1989, "Principal curves").
"""

from collections.abc import Sequence
from typing import Final

import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Float64

from app.sim.rods.geometry.arc_length import arclength_labels, centreline_weights
from app.sim.rods.state import RodState, frames, inextensible

_ROUNDS: Final = 6
_SMOOTHING: Final = 1.0
"""Weight of a squared second difference beside the squared distances of a node's share of points."""
_OUTERMOST, _COVERED = 60, 0.95
"""One of so many points is at an end; the line goes out to this quantile of them."""
_BEYOND: Final = 5.0
"""Segments by which the outer ones are continued, so that points beyond the ends draw them out."""

Line = Float64[np.ndarray, "n 2"]


def principal_curve(points: Float[np.ndarray, "N D"], count: int) -> Line:
    """A line [m] of `count` evenly spread nodes through points [m] of a rope, out to the outermost; ends as they come.

    Each stretch of the rope weighs the same, however many points it has.
    """
    flat = points[:, :2].astype(np.float64)
    labels = arclength_labels(points.astype(np.float32))
    line = evenly_spread(centreline_weights(labels, count).astype(np.float64) @ flat, count)
    second = np.diff(np.eye(count), 2, axis=0)
    for _ in range(_ROUNDS):
        place = _inside(places_along(flat, line, _BEYOND), count)
        first = np.clip(np.floor(place), 0, count - 2).astype(int)
        weights, rows = np.zeros((len(flat), count)), np.arange(len(flat))
        weights[rows, first], weights[rows, first + 1] = 1 - (place - first), place - first
        near = np.round(place).astype(int)
        share = 1 / np.bincount(near, minlength=count)[near]
        share *= len(flat) / share.sum()
        squares = weights.T @ (share[:, None] * weights) + _SMOOTHING * len(flat) / count * second.T @ second
        line = evenly_spread(np.linalg.solve(squares, weights.T @ (share[:, None] * flat)), count)
    return line


def evenly_spread(line: Line, count: int) -> Line:
    """The same polygon with `count` nodes at equal distances along it."""
    at = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    nodes = np.linspace(0.0, at[-1], count)
    return np.stack([np.interp(nodes, at, line[:, axis]) for axis in (0, 1)], axis=1)


def length_m(line: Line) -> float:
    """Length of a line."""
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def places_along(flat: Float64[np.ndarray, "N 2"], line: Line, beyond: float = 0.0) -> Float64[np.ndarray, " N"]:
    """Nearest places on a line, in segments from its first node; outer segments go on for `beyond` of their length."""
    edges = np.diff(line, axis=0)
    low, high = np.zeros(len(edges)), np.ones(len(edges))
    low[0], high[-1] = -beyond, 1 + beyond
    share = ((flat[:, None] - line[:-1]) * edges).sum(2) / (edges**2).sum(1)
    share = np.clip(share, low, high)
    nearest = ((flat[:, None] - line[:-1] - share[..., None] * edges) ** 2).sum(2).argmin(1)
    return nearest + share[np.arange(len(flat)), nearest]


def rods_along(lines: Sequence[Line], points: Sequence[Float[np.ndarray, "N 3"]], rest_m: float) -> list[RodState]:
    """Unmoving rods free of stress, a candidate each: lines with segments `rest_m` long, and points that go with them.

    A point belongs to the nearest place of its line.
    """
    x = inextensible(jnp.asarray(np.stack(lines).transpose(0, 2, 1), jnp.float32), rest_m)
    found = list[RodState]()
    for line, cloud in zip(x, points, strict=True):
        place = places_along(cloud[:, :2].astype(np.float64), np.asarray(line, np.float64).T)[None]
        found.append(RodState.along(line[None])._replace(place=jnp.asarray(place, jnp.float32)))
        found[-1] = _carrying(found[-1], cloud)
    return found


def _carrying(rod: RodState, cloud: Float[np.ndarray, "N 3"]) -> RodState:
    """The rod with the offsets of a cloud's points at their places."""
    middle, tangent = (np.asarray(each[0], np.float64) for each in frames(rod.nodes[:, :2], rod.place))
    d = cloud[:, :2] - middle
    left = d[:, 1] * tangent[:, 0] - d[:, 0] * tangent[:, 1]
    offset = np.stack([(d * tangent).sum(1), left, cloud[:, 2]], axis=1)
    return rod._replace(offset=jnp.asarray(offset[None], jnp.float32))


def _inside(place: Float64[np.ndarray, " N"], count: int) -> Float64[np.ndarray, " N"]:
    """Places moved and stretched so that the outermost points are at the ends."""
    ordered, few = np.sort(place), max(8, len(place) // _OUTERMOST)
    low, high = np.quantile(ordered[:few], 1 - _COVERED), np.quantile(ordered[-few:], _COVERED)
    return np.clip((place - low) / (high - low), 0.0, 1.0) * (count - 1)
