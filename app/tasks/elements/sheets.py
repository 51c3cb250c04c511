"""Cloths on a table and over a rack: where they start and where they shall hang, by seed."""

from dataclasses import dataclass
from typing import Final, final

import numpy as np
from jaxtyping import Float64
from scipy.ndimage import map_coordinates

from app.core.geometry.scene_description import Cloth
from app.core.geometry.shapes.fixtures import Rack
from app.core.types import Points
from app.perception.body.resample import resample
from app.tasks.elements.base import Nodes

_LIES_M: Final = 0.002
"""Height of a lying cloth's middle surface over the table."""
_POINTS_A_PARTICLE: Final = 12


@final
@dataclass(frozen=True, kw_only=True)
class ClothProblems:
    """A flat cloth about `middle_m`, which shall hang over the rack, straight, with half of it on either side.

    It is moved by up to `shift_m` along x and y, and turned by up to `turn_rad` from `about_rad`.
    """

    cloth: Cloth
    rack: Rack
    middle_m: tuple[float, float]
    shift_m: tuple[float, float]
    turn_rad: float
    about_rad: float = 0.0

    def start(self, seed: int) -> Nodes:
        """The knots of the cloth where it lies, row by row."""
        rng = np.random.default_rng(seed)
        x, y = np.add(self.middle_m, rng.uniform(-1.0, 1.0, 2) * self.shift_m)
        turn = self.about_rad + rng.uniform(-self.turn_rad, self.turn_rad)
        axis = np.linspace(-0.5, 0.5, self.cloth.nodes_a_side) * self.cloth.size_m
        u, v = (each.ravel() for each in np.meshgrid(axis, axis, indexing="ij"))
        c, s = np.cos(turn), np.sin(turn)
        return np.stack([x + c * u - s * v, y + s * u + c * v, np.full_like(u, _LIES_M)], axis=1)

    def goal(self, seed: int, particle_count: int) -> Points:
        """The cloth hanging over the rods, evenly spread; the same for every seed."""
        del seed
        side = self.cloth.nodes_a_side
        across, up = self._profile(np.linspace(-0.5, 0.5, side) * self.cloth.size_m)
        along = self.rack.place_m[0] + np.linspace(-0.5, 0.5, side) * self.cloth.size_m
        knots = np.stack([np.repeat(along, side), np.tile(across, side), np.tile(up, side)], axis=1)
        return self.particles(knots, particle_count)

    def particles(self, nodes: Nodes, particle_count: int) -> Points:
        """Evenly spread on the mesh, between its knots."""
        side = self.cloth.nodes_a_side
        fine = int(np.ceil(np.sqrt(_POINTS_A_PARTICLE * particle_count)))
        at = (np.arange(fine) + 0.5) / fine * (side - 1)
        rows, columns = np.meshgrid(at, at, indexing="ij")
        knots = nodes.reshape(side, side, 3)
        points = [map_coordinates(knots[..., axis], [rows, columns], order=1).ravel() for axis in range(3)]
        return resample(np.stack(points, axis=1).astype(np.float32), particle_count, seed=0)

    def _profile(self, s: Float64[np.ndarray, " S"]) -> tuple[Float64[np.ndarray, " S"], Float64[np.ndarray, " S"]]:
        """Places along y and z at arc lengths from the middle: level, round about the outer rods, straight down."""
        rack = self.rack
        radius = rack.radius_m + _LIES_M
        level, bend = (rack.count - 1) * rack.spacing_m / 2, np.pi / 2 * radius
        arc = np.clip(np.abs(s) - level, 0.0, bend) / radius
        hanging = np.maximum(np.abs(s) - level - bend, 0.0)
        out = np.minimum(np.abs(s), level) + radius * np.sin(arc)
        return rack.place_m[1] + np.sign(s) * out, rack.place_m[2] + radius * np.cos(arc) - hanging
