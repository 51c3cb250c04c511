"""Labels of particles: their places along an object, beside its middle, and its direction there."""

from collections.abc import Sequence
from typing import Final

import numpy as np
from jaxtyping import Float32, Float64

from app.core.types import Points
from app.discovery.dataset.model_under_test import RodModel
from app.sim.rods.geometry.arc_length import arclength_labels, centreline_weights, labels_by_rank
from app.sim.rods.state import RodStart

_NODES: Final = 24
"""Nodes of an object's middle."""


def label_particles(
    clouds: Sequence[Points], rods: RodModel | None = None
) -> tuple[Float32[np.ndarray, "K N 4"], Float32[np.ndarray, "K N 3"]]:
    """Labels of particles (see `state.Setting`) and the middle of the object nearest to each.

    Which end is the first is kept from cloud to cloud, by which lies nearer to where it was. `rods`: the order along
    the object is that of its rod, which is right where strands touch, too.
    """
    labels, middles = list[np.ndarray](), list[np.ndarray]()
    last: np.ndarray | None = None
    for cloud in clouds:
        along = arclength_labels(cloud) if rods is None else _along_rod(cloud, rods)
        nodes = centreline_weights(along, _NODES) @ cloud
        if last is not None and np.linalg.norm(nodes - last) > np.linalg.norm(nodes[::-1] - last):
            along, nodes = 1 - along, nodes[::-1]
        last = nodes
        label, middle = label_of(along, cloud)
        labels.append(label)
        middles.append(middle)
    return np.stack(labels).astype(np.float32), np.stack(middles).astype(np.float32)


def label_of(
    along: Float32[np.ndarray, " N"], cloud: Points
) -> tuple[Float64[np.ndarray, "N 4"], Float64[np.ndarray, "N 3"]]:
    """Labels of points that are so far `along` an object (0 to 1), and its middle [m] there."""
    nodes = centreline_weights(along, _NODES) @ cloud
    tangents = np.gradient(nodes[:, :2], axis=0)
    tangents /= np.maximum(np.linalg.norm(tangents, axis=1, keepdims=True), 1e-9)
    at, middle = middles_of(along, cloud)
    tangent = np.stack([np.interp(at, np.arange(_NODES), tangents[:, axis]) for axis in range(2)], axis=1)
    offset = (cloud[:, :2] - middle[:, :2]) @ np.array([[0.0, 1.0], [-1.0, 0.0]])
    left = (offset * tangent).sum(1)
    return np.concatenate([2 * along[:, None] - 1, left[:, None], tangent], axis=1), middle


def _along_rod(cloud: Points, rods: RodModel) -> Float32[np.ndarray, " N"]:
    """Normalised arc length in 0..1 of the points of a rope."""
    return labels_by_rank(RodStart.of(rods.scene).places(cloud[None].astype(np.float32))[0, 0])


def middles_of(
    along: Float32[np.ndarray, " N"], cloud: Points
) -> tuple[Float32[np.ndarray, " N"], Float64[np.ndarray, "N 3"]]:
    """Places among the nodes of an object's middle, and the middle there [m], of points so far `along` it (0 to 1)."""
    nodes = centreline_weights(along, _NODES) @ cloud
    at = np.clip(along * _NODES - 0.5, 0, _NODES - 1)
    return at, np.stack([np.interp(at, np.arange(_NODES), nodes[:, axis]) for axis in range(3)], axis=1)
