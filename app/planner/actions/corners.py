"""Fit of a few straight pieces to a measured path, with their ends at its corners."""

import numpy as np
from jaxtyping import Float, Float64

_SAMPLES = 192
_EQUAL = 1e-3
"""Weight of pieces of equal length against the fit: it decides if the path has fewer corners than pieces."""


def corners(path: Float[np.ndarray, "M K"], pieces: int) -> Float64[np.ndarray, "E K"]:
    """Beginning and end of the way and, in order, the E - 2 = `pieces` - 1 points between at which it turns.

    The first three of the K numbers are places [m].

    The places are those among samples at equal distances for which the squared distances of the way from the straight
    pieces are least; found by dynamic programming (Bellman 1961, "On the approximation of curves by line segments using
    dynamic programming").
    """
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(path, axis=0), axis=1))])
    count = max(_SAMPLES, 4 * pieces) + 1
    samples = np.stack([np.interp(np.linspace(0.0, arc[-1], count), arc, column) for column in path.T], axis=1)
    cost = _costs(samples)
    least, chosen = cost[0], list[np.ndarray]()
    for _ in range(pieces - 1):
        through = least[:, None] + cost
        chosen.append(through.argmin(axis=0))
        least = through.min(axis=0)
    ends = [count - 1]
    for before in reversed(chosen):
        ends.append(int(before[ends[-1]]))
    return samples[[0, *reversed(ends)]]


def _costs(samples: Float64[np.ndarray, "S K"]) -> Float64[np.ndarray, "S S"]:
    """Cost of a straight piece from each sample to each later one; infinite to those that are not later."""
    count = len(samples)
    cost = np.full((count, count), np.inf)
    for begin in range(count):
        for end in range(begin + 1, count):
            share = np.linspace(0.0, 1.0, end - begin + 1)[:, None]
            straight = samples[begin] + share * (samples[end] - samples[begin])
            off = ((samples[begin : end + 1] - straight) ** 2).sum() / count
            cost[begin, end] = off + _EQUAL * ((samples[end, :3] - samples[begin, :3]) ** 2).sum()
    return cost
