"""Model of liquid at rest in a bowl: it is level, and reaches down to the inner wall.

Cameras need to see only part of its surface: much of it is behind the wall of a tilted bowl.
"""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Bool
from scipy.spatial.transform import Rotation

from app.core.types import Cloud, ToolPose

_RIM_M = 0.012
"""Height over a bowl's rim up to which liquid counts as inside, for drops and errors of depth."""
_SPACING_M = 0.002
"""Spacing of the points that count a pool's volume: 120 ml are 15 000."""


_LOWEST, _UNEVEN_M = 0.1, 0.006
"""Quantile of the visible points that is surely not above the level, and range of heights about the level."""


def level_of(seen: Cloud) -> float:
    """Level [m] of a liquid in a bowl from its visible points.

    Nothing of it can be visible below; above, it still falls, splashes, or clings to the wall. So it is the median of
    the points within the errors of depth, and the waves of a surface nearly at rest, over the lowest tenth.
    """
    low = np.quantile(seen[:, 2], _LOWEST)
    return float(np.median(seen[seen[:, 2] < low + _UNEVEN_M, 2]))


@final
@dataclass(frozen=True, kw_only=True)
class Vessel:
    """Half of a hollow sphere of this inner radius about `place_m`, open towards `up`."""

    radius_m: float
    place_m: tuple[float, float, float]
    up: tuple[float, float, float] = (0.0, 0.0, 1.0)

    def at(self, tool: ToolPose) -> "Vessel":
        """The vessel in the hand at this tool pose: upright where the tool points down."""
        up = -Rotation.from_quat(tool[3:7], scalar_first=True).as_matrix()[:, 2]
        x, y, z = (float(number) for number in tool[:3])
        return Vessel(radius_m=self.radius_m, place_m=(x, y, z), up=(float(up[0]), float(up[1]), float(up[2])))

    def holds(self, points: Cloud, margin_m: float = _RIM_M) -> Bool[np.ndarray, " M"]:
        """Mask of the points in it, within a margin at the rim and half of that at the wall."""
        away = points - np.asarray(self.place_m, np.float32)
        near = np.linalg.norm(away, axis=1) < self.radius_m + margin_m / 2
        return near & (away @ np.asarray(self.up, np.float32) < margin_m)

    def pool(self, volume_m3: float) -> "Pool":
        """The pool of this volume at rest; full where the vessel does not hold as much."""
        whole = Pool(vessel=self, level_m=self.place_m[2] + self.radius_m)
        layers, counts = np.unique(whole.points(_SPACING_M)[:, 2], return_counts=True)
        tops, volumes = layers + _SPACING_M / 2, np.cumsum(counts) * _SPACING_M**3
        return Pool(vessel=self, level_m=float(np.interp(volume_m3, [0.0, *volumes], [tops[0] - _SPACING_M, *tops])))


@final
@dataclass(frozen=True, kw_only=True)
class Pool:
    """A liquid at rest in a vessel, up to the height `level_m` in the world."""

    vessel: Vessel
    level_m: float

    @property
    def surface_m2(self) -> float:
        """Area of its surface [m^2], in an upright vessel."""
        below_m = max(0.0, self.vessel.place_m[2] - self.level_m)
        return float(np.pi * max(0.0, self.vessel.radius_m**2 - below_m**2))

    @property
    def volume_m3(self) -> float:
        """Its volume [m^3]."""
        return len(self.points(_SPACING_M)) * _SPACING_M**3

    def points(self, spacing_m: float) -> Cloud:
        """Points throughout it, one for each `spacing_m`^3."""
        place, radius = np.asarray(self.vessel.place_m), self.vessel.radius_m
        axis = np.arange(-radius + spacing_m / 2, radius, spacing_m)
        below = np.arange(self.level_m - spacing_m / 2, place[2] - radius, -spacing_m)
        grid = np.stack(np.meshgrid(place[0] + axis, place[1] + axis, below, indexing="ij"), axis=-1)
        cloud = grid.reshape(-1, 3).astype(np.float32)
        return cloud[self.vessel.holds(cloud, margin_m=0.0)]
