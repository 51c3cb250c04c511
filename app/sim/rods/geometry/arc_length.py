"""Arc-length ordering of a rope: unordered particles to labels in 0..1, and to a centreline."""

import numpy as np
from jaxtyping import Float, Float32
from scipy.sparse import csr_matrix
from scipy.sparse.csgraph import connected_components, dijkstra, minimum_spanning_tree
from scipy.spatial import KDTree
from scipy.spatial.distance import cdist

from app.core.types import Points

_NEIGHBOURS = 10


def arclength_labels(x: Points) -> Float32[np.ndarray, " N"]:
    """Normalised arc length in 0..1 of each particle of `x` (N, 3) [m] of a rope; which end is 0 is arbitrary.

    The longest geodesic of the neighbour graph runs from end to end. Edges cost their squared length, so that a path
    keeps to the rope where two parts of it come close. As particles stand for equal volumes, the rank of a particle's
    distance from the end, not the distance itself, is its share of the length.
    """
    graph = _neighbour_graph(np.asarray(x, np.float64))
    end = int(np.argmax(dijkstra(graph, directed=False, indices=0)))
    return labels_by_rank(dijkstra(graph, directed=False, indices=end))


def labels_by_rank(distance: Float[np.ndarray, " N"]) -> Float32[np.ndarray, " N"]:
    """Normalised arc length in 0..1 of particles that stand for equal volumes, by any distance along it."""
    rank = np.argsort(np.argsort(distance, kind="stable"), kind="stable")
    return ((rank + 0.5) / len(distance)).astype(np.float32)


def centreline_weights(labels: Float32[np.ndarray, " N"], nodes: int) -> Float32[np.ndarray, "nodes N"]:
    """Rows that average particles into the nodes of a centreline: Gaussian in the label, half a node wide."""
    at = (np.arange(nodes) + 0.5) / nodes
    weights = np.exp(-0.5 * ((labels[None, :] - at[:, None]) * nodes / 0.5) ** 2)
    return (weights / weights.sum(1, keepdims=True)).astype(np.float32)


def _neighbour_graph(x: Float[np.ndarray, "N 3"]) -> csr_matrix:
    """Nearest neighbours, and where they fall apart the minimum spanning tree, so that no particle is cut off.

    Squared lengths are the costs. The tree is that of all pairs: at 2000 particles it takes a second.
    """
    near = min(_NEIGHBOURS, len(x) - 1)
    lengths, columns = (np.asarray(found) for found in KDTree(x).query(x, k=near + 1))
    rows = np.repeat(np.arange(len(x)), near)
    local = csr_matrix((lengths[:, 1:].ravel() ** 2, (rows, columns[:, 1:].ravel())), shape=(len(x), len(x)))
    if connected_components(local, directed=False, return_labels=False) == 1:
        return local
    return csr_matrix(local.maximum(minimum_spanning_tree(cdist(x, x, "sqeuclidean"))))
