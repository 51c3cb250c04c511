"""Polygons in the plane: places along them, equal steps, distances and turns."""

import numpy as np
from jaxtyping import Float64, Int64


def places(
    lines: Float64[np.ndarray, "K n 2"], at: Float64[np.ndarray, "N 2"], beyond: float = 0.0
) -> tuple[Float64[np.ndarray, "K N"], Float64[np.ndarray, "K N"]]:
    """Arc position on each line of its point nearest to each of `at`, in segments, and the squared distance [m^2].

    It is on one of the two segments at the nearest node; end segments go on for `beyond` of their length.
    """
    nearest = (np.square(lines).sum(2)[:, None] - 2 * at @ np.swapaxes(lines, 1, 2)).argmin(2)
    one, other = (_on_segment(lines, at, np.clip(nearest - k, 0, lines.shape[1] - 2), beyond) for k in (1, 0))
    nearer = one[1] <= other[1]
    return np.where(nearer, one[0], other[0]), np.where(nearer, one[1], other[1])


def _on_segment(
    lines: Float64[np.ndarray, "K n 2"], at: Float64[np.ndarray, "N 2"], first: Int64[np.ndarray, "K N"], beyond: float
) -> tuple[Float64[np.ndarray, "K N"], Float64[np.ndarray, "K N"]]:
    """The same for the segments that begin at the nodes `first`."""
    which = np.arange(len(lines))[:, None]
    start = lines[which, first]
    (ex, ey), (dx, dy) = np.moveaxis(lines[which, first + 1] - start, 2, 0), np.moveaxis(at - start, 2, 0)
    low, high = np.where(first == 0, -beyond, 0.0), np.where(first == lines.shape[1] - 2, 1 + beyond, 1.0)
    share = np.clip((dx * ex + dy * ey) / np.maximum(ex**2 + ey**2, 1e-12), low, high)
    return first + share, np.square(dx - share * ex) + np.square(dy - share * ey)


def of_equal_steps(lines: Float64[np.ndarray, "K n 2"], rest_m: float, rounds: int = 4) -> Float64[np.ndarray, "K n 2"]:
    """The nearest lines, to first order, whose segments are all `rest_m` long; as `state.inextensible`."""
    count = lines.shape[1] - 1
    at = np.arange(count)
    for _ in range(rounds):
        edges = np.diff(lines, axis=1)
        length = np.maximum(np.linalg.norm(edges, axis=2), 1e-9)
        t = edges / length[..., None]
        beside = -(t[:, 1:] * t[:, :-1]).sum(2)
        matrix = np.zeros((len(lines), count, count))
        matrix[:, at, at] = 2.0
        matrix[:, at[1:], at[:-1]] = matrix[:, at[:-1], at[1:]] = beside
        push = np.linalg.solve(matrix, (rest_m - length)[..., None]) * t
        lines = lines.copy()
        lines[:, 1:] += push
        lines[:, :-1] -= push
    return lines


def distance(one: Float64[np.ndarray, "n 2"], other: Float64[np.ndarray, "n 2"]) -> float:
    """Mean distance of nodes [m], either end first."""
    return float(min(np.linalg.norm(one - each, axis=1).mean() for each in (other, other[::-1])))


def lengths(lines: Float64[np.ndarray, "K n 2"]) -> Float64[np.ndarray, " K"]:
    """Their lengths [m]."""
    return np.linalg.norm(np.diff(lines, axis=1), axis=2).sum(1)


def turns(lines: Float64[np.ndarray, "K n 2"]) -> Float64[np.ndarray, "K n-2"]:
    """Angles between neighbouring segments, without sign [rad]."""
    edges = np.diff(lines, axis=1)
    edges = edges / np.maximum(np.linalg.norm(edges, axis=2, keepdims=True), 1e-9)
    return np.arccos(np.clip((edges[:, 1:] * edges[:, :-1]).sum(2), -1.0, 1.0))


def resample_polyline(line: Float64[np.ndarray, "m 2"], count: int) -> Float64[np.ndarray, "n 2"]:
    """Places at equal distances along a line, from its first point to its last."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(line, axis=0), axis=1))])
    at = np.linspace(0.0, arc[-1], count)
    return np.stack([np.interp(at, arc, line[:, k]) for k in range(2)], axis=1)
