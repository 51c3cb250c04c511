"""Exact volume of a rope: the ground truth of perception, in the tests and here."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float
from scipy.spatial import KDTree

from app.core.types import Points


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Tube:
    """All points within `radius_m` of the polyline `curve [m] (P, 3)`."""

    curve: Float[np.ndarray, "P 3"]
    radius_m: float

    @property
    def volume_m3(self) -> float:
        """Volume [m^3], with the half balls at the ends."""
        length_m = float(np.linalg.norm(np.diff(self.curve, axis=0), axis=1).sum())
        return np.pi * self.radius_m**2 * (length_m + 4 / 3 * self.radius_m)

    def distance_to_axis(self, points: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, " M"]:
        """Distance [m] of each point to the polyline."""
        start, along = self.curve[:-1], np.diff(self.curve, axis=0)
        offset = points[:, None] - start
        share = np.clip((offset * along).sum(-1) / (along**2).sum(-1), 0, 1)
        return np.linalg.norm(offset - share[..., None] * along, axis=-1).min(axis=1)

    def outside(self, points: Float[np.ndarray, "M 3"]) -> Float[np.ndarray, " M"]:
        """Distance of each point to the tube [m]; 0 inside."""
        return np.maximum(self.distance_to_axis(points) - self.radius_m, 0)

    def samples(self, count: int, rng: np.random.Generator) -> Float[np.ndarray, "count 3"]:
        """Points drawn uniformly from its volume."""
        low, high = self.curve.min(axis=0) - self.radius_m, self.curve.max(axis=0) + self.radius_m
        near_axis = KDTree(self.curve)
        reach_m = self.radius_m + float(np.linalg.norm(np.diff(self.curve, axis=0), axis=1).max())
        found = np.empty((0, 3))
        while len(found) < count:
            points = rng.uniform(low, high, (20 * count, 3))
            points = points[np.isfinite(near_axis.query(points, distance_upper_bound=reach_m)[0])]
            found = np.concatenate([found, points[self.distance_to_axis(points) <= self.radius_m]])
        return found[:count]

    def uncovered(self, points: Float[np.ndarray, "M 3"], particles: Points) -> Float[np.ndarray, " M"]:
        """Distance of each point to the nearest of the balls that equal shares of the volume make [m]; 0 inside."""
        ball_m = (3 * self.volume_m3 / (4 * np.pi * len(particles))) ** (1 / 3)
        return np.maximum(KDTree(particles).query(points)[0] - ball_m, 0)
