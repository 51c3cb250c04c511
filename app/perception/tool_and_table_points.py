"""Points of the bare table and the tip of the finger, with which discovery checks cameras and arm."""

from collections.abc import Sequence
from typing import TypeAlias

import numpy as np
from jaxtyping import Bool, Float32
from scipy.spatial import KDTree

from app.core.colours import Mask
from app.core.messages import Frame
from app.core.types import Cloud
from app.perception.cloud.depth import behind_an_edge, deproject
from app.perception.reconstruct import Reconstruction
from app.perception.tool_tip_fit import tool_points

__all__ = ["table_points", "tool_points"]

Some: TypeAlias = Float32[np.ndarray, "_ 3"]
"""Any number of points [m]."""

_TABLE_POINTS = 400
_LEAST_POINTS = 60
"""Fewest readings that determine a plane."""
_NEAR_TABLE_M = 0.020
"""Height up to which a point is on the table or lies on it: more than cameras err, and an object's height does not
matter."""
_AWAY_M = 0.030
"""Distance of bare table from everything on it, seen from above."""
_PIXELS_APART = 3
_SIGMAS = 3.0
_MEDIAN_TO_SIGMA = 1.4826
"""Ratio of the standard deviation of normal numbers to the median of their absolute values."""
_NOTHING: Cloud = np.zeros((0, 3), np.float32)


def table_points(frames: Sequence[Frame], how: Reconstruction, *, seed: int = 0) -> Cloud:
    """About 400 points [m, world] of the bare table; none where too little of it is visible.

    They lie in the box of `how`, 3 cm or more beside everything raised over the table or of the object's colour, and
    within three standard deviations of their plane, so that a least-squares plane may be fitted to them.
    """
    level, others = list[Cloud](), list[Cloud]()
    for frame in frames:
        coloured = how.segmenting.masks(frame.color)[0]
        points = _readings(frame, _sparse(coloured.shape) & ~coloured, how)
        low = np.abs(points[:, 2] - how.table_m) < _NEAR_TABLE_M
        level.append(points[low])
        others += [points[points[:, 2] > how.table_m + _NEAR_TABLE_M], _readings(frame, coloured, how)]
    if not level:
        return _NOTHING
    bare = _within_box(np.concatenate(level), how)
    bare = bare[_far_from(bare, np.concatenate(others))]
    return _random_subset(_near_plane(bare), _TABLE_POINTS, seed) if len(bare) >= _LEAST_POINTS else _NOTHING


def _readings(frame: Frame, mask: Mask, how: Reconstruction) -> Cloud:
    """The masked pixels as points, without those between two surfaces."""
    return deproject(frame.depth, mask & ~behind_an_edge(frame.depth, how.edge_step_m, frame.camera), frame.camera)


def _sparse(shape: tuple[int, ...]) -> Mask:
    mask = np.zeros(shape, bool)
    mask[::_PIXELS_APART, ::_PIXELS_APART] = True
    return mask


def _within_box(points: Cloud, how: Reconstruction) -> Some:
    """The points over the box's ground area."""
    low, high = np.asarray(how.box.low[:2]), np.asarray(how.box.high[:2])
    return points[np.all((points[:, :2] >= low) & (points[:, :2] <= high), axis=1)]


def _far_from(points: Cloud, others: Some) -> Bool[np.ndarray, " M"]:
    """Mask of the bare points, seen from above."""
    if not len(others) or not len(points):
        return np.ones(len(points), bool)
    return KDTree(others[:, :2]).query(points[:, :2], distance_upper_bound=_AWAY_M)[0] > _AWAY_M


def _near_plane(points: Cloud) -> Some:
    """The points within a few standard deviations of their plane, estimated by the median, in two rounds."""
    for _ in range(2):
        rows = np.concatenate([points[:, :2] - points[:, :2].mean(axis=0), np.ones((len(points), 1))], axis=1)
        off = points[:, 2] - rows @ np.linalg.lstsq(rows, points[:, 2], rcond=None)[0]
        points = points[np.abs(off) <= _SIGMAS * _MEDIAN_TO_SIGMA * np.median(np.abs(off))]
    return points


def _random_subset(points: Cloud, count: int, seed: int) -> Some:
    """A random selection of `count` points; all where there are no more."""
    return np.random.default_rng(seed).permutation(points)[:count]
