"""Rods: cylinders with round ends, alone or side by side as a rack."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

from dataclasses import dataclass
from typing import final

import warp as wp

from app.sim.constants import Shape
from app.sim.tools.base import Motion, Primitive, Vector, safe_norm


@wp.func
def rod_surface(s: Shape, p: wp.vec3):
    """A capsule along y: half length, radius."""
    away = p - wp.vec3(0.0, wp.clamp(p[1], -s.size[0], s.size[0]), 0.0)
    distance = safe_norm(away)
    return away / distance, distance - s.size[1], 1.0


@final
@dataclass(frozen=True, kw_only=True)
class Rod:
    """Along y, its middle at `place_m`."""

    half_length_m: float
    radius_m: float
    place_m: Vector = (0.0, 0.0, 0.0)
    friction: float = 0.3
    motion: Motion = "fixed"

    def primitives(self) -> tuple[Primitive, ...]:
        """One."""
        size = (self.half_length_m, self.radius_m, 0.0, 0.0)
        return (Primitive(surface=rod_surface, size=size, friction=self.friction, place=self.place_m, thin=True),)


@final
@dataclass(frozen=True, kw_only=True)
class Rack:
    """`count` parallel rods along y, `spacing_m` apart along x, their middle at `place_m`."""

    count: int
    spacing_m: float
    half_length_m: float
    radius_m: float
    place_m: Vector = (0.0, 0.0, 0.0)
    friction: float = 0.3
    motion: Motion = "fixed"

    def primitives(self) -> tuple[Primitive, ...]:
        """One a rod."""
        x, y, z = self.place_m
        offsets = [(i - (self.count - 1) / 2) * self.spacing_m for i in range(self.count)]
        size = (self.half_length_m, self.radius_m, 0.0, 0.0)
        return tuple(
            Primitive(surface=rod_surface, size=size, friction=self.friction, place=(x + dx, y, z), thin=True)
            for dx in offsets
        )
