"""Labels of particles: their places along an object, beside its middle, and its direction there."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from jaxtyping import Float32, Float64

from app.core.types import Points
from app.discovery.dataset.model_under_test import RodModel
from app.discovery.dataset.object_kinds import ROPE, ObjectTraits
from app.sim.rods.geometry.arc_length import arclength_labels, centreline_weights, labels_by_rank
from app.sim.rods.state import RodStart

_NODES: Final = 24
"""Nodes of an object's middle."""


def label_particles(
    clouds: Sequence[Points], rods: RodModel | None = None, kind: ObjectTraits = ROPE
) -> tuple[Float32[np.ndarray, "K N 4"], Float32[np.ndarray, "K N 3"]]:
    """Labels of particles (see `state.Setting`) and the middle of the object nearest to each.

    Which end is the first is kept from cloud to cloud, by which lies nearer to where it was. `rods`: the order along
    the object is that of its rod, which is right where strands touch, too. What has no length has no labels.
    """
    if not kind.has_length:
        nothing = [no_labels(cloud) for cloud in clouds]
        return np.stack([label for label, _ in nothing]).astype(np.float32), np.stack(clouds).astype(np.float32)
    labels, middles = list[np.ndarray](), list[np.ndarray]()
    last: np.ndarray | None = None
    for cloud in clouds:
        along = places_along(cloud, rods)
        nodes = _nodes(along, cloud)
        if last is not None and np.linalg.norm(nodes - last) > np.linalg.norm(nodes[::-1] - last):
            along, nodes = 1 - along, nodes[::-1]
        last = nodes
        label, middle = _label(along, nodes, cloud)
        labels.append(label)
        middles.append(middle)
    return np.stack(labels).astype(np.float32), np.stack(middles).astype(np.float32)


def label_of(
    along: Float32[np.ndarray, " N"], cloud: Points
) -> tuple[Float64[np.ndarray, "N 4"], Float64[np.ndarray, "N 3"]]:
    """Labels of points that are so far `along` an object (0 to 1), and its middle [m] there."""
    return _label(along, _nodes(along, cloud), cloud)


def no_labels(cloud: Points) -> tuple[Float64[np.ndarray, "N 4"], Float64[np.ndarray, "N 3"]]:
    """Labels of an object without a length, which say nothing; each point is its own middle."""
    return np.zeros((len(cloud), 4)), cloud.astype(np.float64)


def middles_of(along: Float32[np.ndarray, " N"], cloud: Points) -> Float64[np.ndarray, "N 3"]:
    """The middle of an object [m] at points so far `along` it (0 to 1)."""
    return _between(_nodes(along, cloud), along)


def places_along(cloud: Points, rods: RodModel | None = None) -> Float32[np.ndarray, " N"]:
    """Normalised arc length in 0..1 of the points of a rope, by its rod where it has one."""
    if rods is None:
        return arclength_labels(cloud)
    return labels_by_rank(RodStart.of(rods.scene).places(cloud[None].astype(np.float32))[0, 0])


def _nodes(along: Float32[np.ndarray, " N"], cloud: Points) -> Float32[np.ndarray, "M 3"]:
    return centreline_weights(along, _NODES) @ cloud


def _label(
    along: Float32[np.ndarray, " N"], nodes: Float32[np.ndarray, "M 3"], cloud: Points
) -> tuple[Float64[np.ndarray, "N 4"], Float64[np.ndarray, "N 3"]]:
    tangents = np.gradient(nodes[:, :2], axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-9)
    middle, tangent = _between(nodes, along), _between(tangents, along)
    offset = (cloud[:, :2] - middle[:, :2]) @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    left = (offset * tangent).sum(1)
    return np.concatenate([2 * along[:, None] - 1, left[:, None], tangent], axis=1), middle


def _between(nodes: Float32[np.ndarray, "M D"], along: Float32[np.ndarray, " N"]) -> Float64[np.ndarray, "N D"]:
    """Values at the nodes of an object's middle, interpolated so far `along` it (0 to 1)."""
    at = np.clip(along * _NODES - 0.5, 0, _NODES - 1)
    return np.stack([np.interp(at, np.arange(_NODES), column) for column in nodes.T], axis=1)
