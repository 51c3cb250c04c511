"""Resampling of a body to a given number of evenly spread particles."""

import numpy as np
from jaxtyping import Int
from scipy.spatial import KDTree

from app.core.types import Cloud, Points

_ROUNDS = 6
"""Lloyd's method gains most of its evenness in the first rounds: bench/perception.py shows the coverage."""
_BITS = 10
"""Bits of each coordinate in the Morton code: 1024 steps over the extent of the body."""


def resample(body: Cloud, count: int, *, seed: int) -> Points:
    """`count` particles that share the points of `body` evenly: each at the mean of the points nearest to it.

    Lloyd's method (Lloyd 1982). It starts from points drawn at even intervals along a space-filling curve, which are
    well spread already; neighbours along the curve stay neighbours in the order of the particles. `body` needs at
    least `count` points. The same seed gives the same particles.
    """
    if len(body) < count:
        raise ValueError(f"{len(body)} points cannot be shared by {count} particles.")
    rng = np.random.default_rng(seed)
    start = (np.arange(count) + rng.random(count)) * (len(body) / count)
    particles = body[np.argsort(_morton(body), kind="stable")[start.astype(np.intp)]]
    for _ in range(_ROUNDS):
        particles = _centre(particles, body)
    return particles


def _centre(particles: Points, body: Cloud) -> Points:
    """Each particle moved to the mean of the body's points nearest to it, or unchanged where there are none."""
    _, owner = KDTree(particles).query(body)
    count = np.bincount(owner, minlength=len(particles))
    total = np.stack([np.bincount(owner, axis, len(particles)) for axis in body.T], axis=1)
    return np.where(count[:, None] > 0, total / np.maximum(count, 1)[:, None], particles).astype(np.float32)


def _morton(points: Cloud) -> Int[np.ndarray, " M"]:
    """The place of each point along the Z-order curve (Morton 1966): the bits of x, y and z interleaved."""
    low = points.min(axis=0)
    extent = max(float((points.max(axis=0) - low).max()), np.finfo(np.float32).eps)
    steps = ((points - low) * (((1 << _BITS) - 1) / extent)).astype(np.int64)
    code = np.zeros(len(points), np.int64)
    for bit in range(_BITS):
        for axis in range(3):
            code |= ((steps[:, axis] >> bit) & 1) << (3 * bit + axis)
    return code
