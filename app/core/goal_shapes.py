"""Goal shapes drawn by an operator: the object laid along a curve, moved and bent, or gathered in a region. Pure.

Console and planner share this code, so that the goal that is drawn is the goal that is planned for.
"""

import numpy as np
from jaxtyping import Float64, Int
from scipy.sparse.csgraph import dijkstra
from scipy.spatial import KDTree

from app.core.types import Points

_NEIGHBOURS = 12
_WINDOW = 0.06
"""Share of the particles, in order along the object, over which its centreline is averaged."""
_GOLDEN_RAD = np.pi * (3 - np.sqrt(5))
_STRAIGHT_1_M = 1e-6
"""Curvature [1/m] below which a bend counts as straight."""


def along(object_: Points, curve: Float64[np.ndarray, "C 2"]) -> Points:
    """The object (N, 3) [m], something long and thin, with its centreline along `curve` (C, 2), C > 1 [m].

    It keeps its length and thickness: beyond the end of a shorter curve it goes on straight, and on a longer one it
    ends early.
    """
    centre, normal, arc_m = _centreline(object_)
    offset = ((object_[:, :2] - centre) * normal).sum(1)
    steps_m = np.linalg.norm(np.diff(curve, axis=0), axis=1)
    kept = np.concatenate([[True], steps_m > 0])
    nodes, at_m = curve[kept], np.concatenate([[0.0], np.cumsum(steps_m[steps_m > 0])])
    ahead = (nodes[-1] - nodes[-2]) / np.linalg.norm(nodes[-1] - nodes[-2])
    beyond = np.maximum(arc_m - at_m[-1], 0.0)[:, None] * ahead
    place = np.stack([np.interp(arc_m, at_m, nodes[:, axis]) for axis in range(2)], axis=1) + beyond
    piece = np.clip(np.searchsorted(at_m, arc_m, side="right") - 1, 0, len(nodes) - 2)
    tangent = np.diff(nodes, axis=0)[piece] / np.diff(at_m)[piece, None]
    across = np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)
    return np.column_stack([place + offset[:, None] * across, object_[:, 2]]).astype(np.float32)


def transform(object_: Points, *, to: Float64[np.ndarray, "2"], turn_rad: float, bend_1_m: float) -> Points:
    """The object (N, 3) [m] with its centroid at `to` [m], turned about the vertical, and bent in the plane.

    `bend_1_m`: the curvature that it gets along its longer side (Barr 1984, "Global and local deformations of solid
    primitives", section 3.4).
    """
    middle = object_[:, :2].mean(0)
    flat = (object_[:, :2] - middle).astype(np.float64)
    axis = np.linalg.svd(flat, full_matrices=False)[2][0]
    frame = np.stack([axis, [-axis[1], axis[0]]], axis=1)
    long, wide = (flat @ frame).T
    if abs(bend_1_m) > _STRAIGHT_1_M:
        angle = bend_1_m * long
        long, wide = (
            np.sin(angle) / bend_1_m - wide * np.sin(angle),
            (1 - np.cos(angle)) / bend_1_m + wide * np.cos(angle),
        )
    cos, sin = np.cos(turn_rad), np.sin(turn_rad)
    turned = np.stack([long, wide], axis=1) @ frame.T @ np.array([[cos, sin], [-sin, cos]])
    return np.column_stack([turned - turned.mean(0) + to, object_[:, 2]]).astype(np.float32)


def gather(object_: Points, *, middle: Float64[np.ndarray, "2"], radius_m: float) -> Points:
    """As many particles as the object (N, 3) [m] has, spread evenly over a disc, at the heights that they have.

    Vogel's spiral (Vogel 1979): the i-th at the golden angle times i, at a radius that grows with the root of i.
    """
    index = np.arange(len(object_))
    radius = radius_m * np.sqrt((index + 0.5) / len(object_))
    angle = _GOLDEN_RAD * index
    disc = middle + radius[:, None] * np.stack([np.cos(angle), np.sin(angle)], axis=1)
    return np.column_stack([disc, object_[:, 2]]).astype(np.float32)


def _centreline(
    object_: Points,
) -> tuple[Float64[np.ndarray, "N 2"], Float64[np.ndarray, "N 2"], Float64[np.ndarray, " N"]]:
    """Centreline point, unit normal there, and arc length [m] beside each particle."""
    order = _order(object_)
    flat = object_[order, :2].astype(np.float64)
    half = max(int(_WINDOW * len(flat) / 2), 1)
    total = np.concatenate([np.zeros((1, 2)), np.cumsum(flat, axis=0)])
    index = np.arange(len(flat))
    low, high = np.maximum(index - half, 0), np.minimum(index + half + 1, len(flat))
    line = (total[high] - total[low]) / (high - low)[:, None]
    tangent = np.gradient(line, axis=0)
    tangent /= np.maximum(np.linalg.norm(tangent, axis=1, keepdims=True), 1e-12)
    length_m = _length(flat)
    back = np.argsort(order)
    arc_m = length_m * (index + 0.5) / len(flat)
    return line[back], np.stack([-tangent[:, 1], tangent[:, 0]], axis=1)[back], arc_m[back]


def _order(object_: Points) -> Int[np.ndarray, " N"]:
    """Indices of the particles from one end to the other, by geodesic distance from an end of the longest path.

    Strands that touch are a short cut, so an object that lies across itself is ordered wrongly there.
    """
    tree = KDTree(object_)
    reach_m = float(np.max(tree.query(object_, min(_NEIGHBOURS, len(object_)))[0]))
    apart = tree.sparse_distance_matrix(tree, reach_m, output_type="coo_matrix")
    far = dijkstra(apart, directed=False, indices=0)
    end = int(np.argmax(np.where(np.isfinite(far), far, -1.0)))
    ways = dijkstra(apart, directed=False, indices=end)
    return np.argsort(np.where(np.isfinite(ways), ways, np.inf), kind="stable")


def _length(ordered: Float64[np.ndarray, "N 2"]) -> float:
    """End-to-end length [m] of points in order: between the means of 20 parts, plus half a part at either end."""
    parts = np.array([part.mean(0) for part in np.array_split(ordered, min(20, len(ordered)))])
    steps_m = np.linalg.norm(np.diff(parts, axis=0), axis=1)
    return float(steps_m.sum() + steps_m.mean())
