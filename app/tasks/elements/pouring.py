"""Common part of the pouring tasks: places of the bowls, their filling, and the simulator's scene of them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.bowls import cap_depth_m
from app.core.geometry.scene_description import Liquid, Soup
from app.core.geometry.shapes.fixtures import Bowl
from app.core.geometry.shapes.tools import HeldBowl
from app.core.types import Cloud, Points
from app.perception.body.resample import resample
from app.sim.materials.elastic import Elastic
from app.sim.materials.liquid import LiquidMaterial
from app.sim.model.scene import Body, Scene
from app.sim.tools.bowl import BowlCollider
from app.tasks.elements.base import Nodes

_POINTS_A_PARTICLE = 8
_SOFTENED = 0.25
"""Factor on phi's stiffness: at 4e4 Pa, 3 cm of water shrink by 3 %, and time steps may be twice as long."""
_PIECES_SOFTENED = 0.15
"""The same for Young's modulus of pieces: 6 kPa, that of soft tofu."""
_SPRAY = 3.0
"""Limit of a drop's relative volume at which poured liquid stands as high as its volume: see the material."""
_RANDOM_M = 0.02
"""Standard deviation of where the held bowl is at first, along x and y, as in the reference problem; cut off at two."""


def aside_m(seed: int) -> Float64[np.ndarray, "3"]:
    """Random initial offset [m] of the held bowl from its waiting place, by seed."""
    return np.append(np.random.default_rng(seed).standard_normal(2).clip(-2, 2) * _RANDOM_M, 0.0)


@final
@dataclass(frozen=True, kw_only=True)
class PouringProblems:
    """All of the liquid rests in the held bowl about `home_m`, a little aside by seed, and shall be in the other."""

    liquid: Liquid
    held: HeldBowl
    target: Bowl
    home_m: tuple[float, float, float]

    def start(self, seed: int) -> Nodes:
        """The liquid in the held bowl."""
        middle = np.asarray(self.home_m) + aside_m(seed)
        volume_m3 = self.liquid.volume_m3
        return pool(middle, self.held.radius_m, volume_m3=volume_m3, count=self.liquid.drops).astype(np.float64)

    def goal(self, seed: int, particle_count: int) -> Points:
        """The liquid at rest in the other bowl."""
        del seed
        middle, volume_m3 = np.asarray(self.target.place_m), self.liquid.volume_m3
        return pool(middle, self.target.radius_m, volume_m3=volume_m3, count=particle_count)

    def particles(self, nodes: Nodes, particle_count: int) -> Points:
        """Particles that share the world's volume."""
        return resample(nodes.astype(np.float32), particle_count, seed=0)


def pool(middle: Float64[np.ndarray, "3"], radius_m: float, *, volume_m3: float, count: int) -> Points:
    """`count` particles [m] that share this volume of a liquid at rest in an upright bowl about `middle` [m]."""
    cloud = pool_points(radius_m, volume_m3, _POINTS_A_PARTICLE * count)
    return resample((cloud + middle).astype(np.float32), count, seed=0)


def pool_points(radius_m: float, volume_m3: float, count: int) -> Cloud:
    """About `count` points throughout a liquid at rest in half a sphere about the origin [m]."""
    depth, spacing = cap_depth_m(volume_m3, radius_m), float(np.cbrt(volume_m3 / count))
    axis = np.arange(-radius_m, radius_m, spacing)
    points = np.stack(np.meshgrid(axis, axis, np.arange(-radius_m, depth - radius_m, spacing)), axis=-1).reshape(-1, 3)
    return points[np.linalg.norm(points, axis=1) < radius_m].astype(np.float32)


def pouring_scene(body: Liquid | Soup, held: HeldBowl, target: Bowl, *, particle_count: int) -> Scene:
    """The planner's scene: the held bowl turns, the other is fixed. Cells are twice the particles' spacing.

    All pieces in a soup are one body.
    """
    spacing = float(np.cbrt(body.volume_m3 / particle_count))
    return Scene(
        low=(0.15, -0.30, -0.03),
        high=(0.90, 0.30, 0.42),
        cell_m=0.015,
        dt_s=2e-3,
        damping_1_s=1.0,
        contact_margin_m=0.5 * spacing,
        contact_width_m=0.0015,
        bodies=tuple(_bodies(body)),
        tools=(BowlCollider.that_pours(held), BowlCollider.that_stands(target)),
    )


def _bodies(body: Liquid | Soup) -> Sequence[Body]:
    liquid = body.liquid if isinstance(body, Soup) else body
    poured = Body(
        volume_m3=liquid.volume_m3,
        density_kg_m3=liquid.density_kg_m3,
        material=LiquidMaterial(spray=_SPRAY),
        stiffness=_SOFTENED,
    )
    if not isinstance(body, Soup):
        return [poured]
    mass_kg = sum(kind.density_kg_m3 * kind.volume_m3 for kind in body.pieces)
    pieces = Body(
        volume_m3=body.solid_m3,
        density_kg_m3=mass_kg / body.solid_m3,
        material=Elastic(),
        stiffness=_PIECES_SOFTENED,
    )
    return [poured, pieces]
