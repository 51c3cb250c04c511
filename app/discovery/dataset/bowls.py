"""Two bowls, and the share of a liquid that is in each, as cameras and their reconstruction show it."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Bool, Float64

from app.core.geometry.bowls import cap_centroid_m, cap_depth_m, cap_surface_m2, cap_volume_m3, refill
from app.core.types import Points

_OUTSIDE_M = 0.003
"""Distance from the outside of a bowl within which a particle is in it: particles are centres of matter."""
_LEAST = 0.05
"""Share of what a bowl is said to hold that is in it at least."""


@final
@dataclass(frozen=True, kw_only=True)
class PouredBowls:
    """A bowl in the hand and one that stands; radii are inner ones, `volume_m3` is that of all liquid."""

    held_radius_m: float
    place_m: tuple[float, float, float]
    radius_m: float
    wall_m: float
    volume_m3: float

    def holds(self, points: Points, tool_m: Float64[np.ndarray, "3"]) -> Bool[np.ndarray, " N"]:
        """Mask of the points in a held bowl with its centre at `tool_m`."""
        return _within(points, tool_m, self.held_radius_m + self.wall_m)

    def inside(self, points: Points) -> Bool[np.ndarray, " N"]:
        """Mask of the points in the bowl that stands, which is half of a ball: above its rim the other one is held."""
        low = points[:, 2] < self.place_m[2] + _OUTSIDE_M
        return low & _within(points, np.array(self.place_m), self.radius_m + self.wall_m)

    def carry(self, points: Points, tool_m: Float64[np.ndarray, "3"], to_m: Float64[np.ndarray, "3"]) -> Points:
        """The points, with those in a held bowl at `tool_m` moved as the bowl is moved to `to_m`."""
        moved = points.copy()
        moved[self.holds(points, tool_m) & ~self.inside(points)] += (to_m - tool_m).astype(points.dtype)
        return moved

    def fill(self, points: Points, tool_m: Float64[np.ndarray, "3"], more: float) -> Points:
        """The points where there is more of the liquid in a held bowl at `tool_m`, by a share of all of it."""
        held = self.holds(points, tool_m) & ~self.inside(points)
        if not held.any() or more == 0:
            return points
        volume_m3, filled = float(held.mean()) * self.volume_m3, points.copy()
        to_m3 = max(volume_m3 + more * self.volume_m3, _LEAST * volume_m3)
        filled[held] = refill(points[held].astype(np.float64), tool_m, self.held_radius_m, volume_m3, to_m3)
        return filled

    def worth(self, share: float, more: float) -> float:
        """Volume of a particle in the held bowl over that of others, where this `share` of all stands and more is held.

        Particles are as many as if it was as much as is said.
        """
        return max(1 + more / (1 - share), _LEAST) if share < 1 else 1.0

    def share(self, points: Points) -> float:
        """Share of the liquid in the bowl that stands."""
        return float(self.inside(points).mean())

    def seen_share(self, points: Points) -> float:
        """The same of seen points: above 1 where all of what was said is in it, and the level is higher than that."""
        if not self.inside(points).all():
            return self.share(points)
        below_m = self.place_m[2] - float(points[:, 2].mean(dtype=np.float64))
        return max(cap_volume_m3(below_m, self.radius_m) / self.volume_m3, 1.0)

    def rise(self, share: float, by_m: float) -> float:
        """Share by which a liquid of this `share` in it seems more where its level is seen too high by `by_m`."""
        if share <= 0:
            return 0.0  # No level is seen in an empty bowl.
        return cap_surface_m2(share * self.volume_m3, self.radius_m) * by_m / self.volume_m3

    def with_share(self, points: Points, share: float) -> Points:
        """The points, as many of them moved from or to the bowl that stands as makes its share this one.

        For counting: those that are moved lie all at one point, in the bowl or above it, where no liquid could be.
        Where all is in the bowl, it stands as high as its level tells as much.
        """
        wanted = round(max(share, 0.0) * len(points))
        if wanted >= len(points):
            return self._standing(points, share)
        inside = np.flatnonzero(self.inside(points))
        moved = points.copy()
        if wanted > len(inside):
            others = np.setdiff1d(np.arange(len(points)), inside)
            moved[others[: wanted - len(inside)]] = self.place_m
        else:
            moved[inside[: len(inside) - wanted]] = np.add(self.place_m, (0.0, 0.0, 4 * self.radius_m))
        return moved

    def _standing(self, points: Points, share: float) -> Points:
        """The points, all of them in the bowl that stands, as high as this share of the liquid stands in it."""
        depth_m = cap_depth_m(share * self.volume_m3, self.radius_m)
        middle = np.subtract(self.place_m, (0.0, 0.0, cap_centroid_m(depth_m, self.radius_m))).astype(points.dtype)
        standing = np.where(self.inside(points)[:, None], points, middle)
        standing[:, 2] += middle[2] - standing[:, 2].mean()
        return standing if self.inside(standing).all() else np.tile(middle, (len(points), 1))


def _within(points: Points, centre: Float64[np.ndarray, "3"], radius_m: float) -> Bool[np.ndarray, " N"]:
    return np.linalg.norm(points - centre, axis=1) < radius_m + _OUTSIDE_M
