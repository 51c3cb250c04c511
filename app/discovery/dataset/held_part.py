"""Part of a cloth between the fingers that hold it, which no camera sees."""

from dataclasses import replace
from typing import Final

import numpy as np
from jaxtyping import Float32, Float64
from scipy.spatial import KDTree

from app.core.geometry.shapes.base import GripperFingers
from app.core.types import OPENING
from app.discovery.dataset.study import Push, Study

_SPACING_M: Final = 0.008
"""Distance between points that are added: half of that between particles."""
REACH_M: Final = 0.04
"""Distance from the fingers to the cloth that is seen, beyond which they do not hold it."""
_ACROSS: Final = 5
"""Points between the fingers, along their width."""


def with_held_parts(study: Study, fingers: GripperFingers) -> Study:
    """The study with clouds that reach the gripper, before each motion that begins with it closed."""
    return replace(study, pushes=tuple(_with_held_part(push, fingers) for push in study.pushes))


def _with_held_part(push: Push, fingers: GripperFingers) -> Push:
    """As many points as there were: some of those seen are left out for those between the fingers."""
    pose = push.track.poses[0]
    if len(pose) <= OPENING or pose[OPENING] > fingers.closed_m:
        return push
    x = push.before.points
    added = _between(x.astype(np.float64), pose, fingers)
    kept = np.random.default_rng(0).permutation(len(x))[: max(len(x) - len(added), 0)]
    whole = np.concatenate([x[np.sort(kept)], added.astype(np.float32)])[: len(x)]
    return replace(push, before=replace(push.before, points=whole))


def _between(
    x: Float64[np.ndarray, "N 3"], pose: Float64[np.ndarray, "8"], fingers: GripperFingers
) -> Float32[np.ndarray, "M 3"]:
    """Points on the line between the fingers' tips, and from it to the nearest points that are seen.

    Only where these are within `REACH_M`.
    """
    across = np.array([pose[4] ** 2 - pose[5] ** 2, 2 * pose[4] * pose[5], 0.0])
    line = pose[:3] + np.linspace(-1, 1, _ACROSS)[:, None] * fingers.half_m[0] * across
    away_m, nearest = KDTree(x).query(line)
    parts = [np.zeros((0, 3))]
    for begin, end, distance_m in zip(line, x[nearest], away_m, strict=True):
        if distance_m <= REACH_M:
            count = max(int(distance_m // _SPACING_M), 1)
            parts.append(begin + np.arange(count)[:, None] / count * (end - begin))
    return np.concatenate(parts).astype(np.float32)
