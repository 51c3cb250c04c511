"""Random smooth curves on the table: where a rope starts and where it shall go."""

import numpy as np
from jaxtyping import Float64

from app.config import Workspace

_TRIES = 1000


def random_curve(
    rng: np.random.Generator,
    *,
    length_m: float,
    height_m: float,
    workspace: Workspace,
    margin_m: float = 0.08,
    max_turn_rad: float = 2.4,
    min_gap_m: float = 0.04,
    points: int = 81,
) -> Float64[np.ndarray, "points 3"]:
    """A planar curve of exactly `length_m` at z = `height_m`, inside the workspace less `margin_m`.

    Its heading is a random sum of two half-waves over the arc length, so its curvature is smooth; curves that come
    closer to themselves than `min_gap_m` are drawn again.
    """
    low, high = np.asarray(workspace.low[:2]) + margin_m, np.asarray(workspace.high[:2]) - margin_m
    arc = np.linspace(0.0, 1.0, points)
    for _ in range(_TRIES):
        amplitude = rng.uniform(-max_turn_rad, max_turn_rad, size=2) / np.array([1.0, 2.0])
        heading = rng.uniform(0, 2 * np.pi) + amplitude @ np.stack([np.sin(np.pi * arc), np.sin(2 * np.pi * arc)])
        middle = (heading[1:] + heading[:-1]) / 2
        steps = length_m / (points - 1) * np.stack([np.cos(middle), np.sin(middle)], axis=1)
        curve = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
        room = (high - low) - np.ptp(curve, axis=0)
        if np.any(room <= 0) or _self_gap(curve, length_m) < min_gap_m:
            continue
        curve += low - curve.min(axis=0) + rng.uniform(0, 1, 2) * room
        return np.concatenate([curve, np.full((points, 1), height_m)], axis=1)
    raise ValueError(f"No curve of {length_m} m fits the workspace in {_TRIES} tries; make it shorter.")


def _self_gap(curve: Float64[np.ndarray, "points 2"], length_m: float) -> float:
    """The smallest distance between points that lie a quarter of the length or more apart along the curve."""
    apart = max(1, int(len(curve) * 0.25))
    distance = np.linalg.norm(curve[:, None] - curve[None], axis=-1)
    i, j = np.indices(distance.shape)
    return float(distance[j - i >= apart].min(initial=length_m))
