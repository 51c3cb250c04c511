"""Rods: cylinders with round ends, alone or side by side as a rack."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

from dataclasses import dataclass
from math import sqrt
from typing import Literal, final

import warp as wp

from app.sim.constants import Shape
from app.sim.tools.base import Motion, Primitive, Quaternion, Vector, safe_norm

_AS_THEY_ARE: Quaternion = (1.0, 0.0, 0.0, 0.0)
_QUARTER_TURN: Quaternion = (sqrt(0.5), 0.0, 0.0, sqrt(0.5))
"""Quarter turn about the vertical: takes y to x."""


@wp.func
def rod_surface(s: Shape, p: wp.vec3):
    """A capsule along y: half length, radius."""
    away = p - wp.vec3(0.0, wp.clamp(p[1], -s.size[0], s.size[0]), 0.0)
    distance = safe_norm(away)
    return away / distance, distance - s.size[1], 1.0


@final
@dataclass(frozen=True, kw_only=True)
class RodCollider:
    """Rod along y, its middle at `place_m`."""

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
class RackCollider:
    """`count` parallel rods, `spacing_m` apart, the middle of all at `place_m`; along y, or along x."""

    count: int
    spacing_m: float
    half_length_m: float
    radius_m: float
    place_m: Vector = (0.0, 0.0, 0.0)
    friction: float = 0.3
    along: Literal["x", "y"] = "y"
    motion: Motion = "fixed"

    def primitives(self) -> tuple[Primitive, ...]:
        """One a rod."""
        x, y, z = self.place_m
        offsets = [(i - (self.count - 1) / 2) * self.spacing_m for i in range(self.count)]
        places = [(x + at, y, z) if self.along == "y" else (x, y + at, z) for at in offsets]
        size = (self.half_length_m, self.radius_m, 0.0, 0.0)
        turn = _AS_THEY_ARE if self.along == "y" else _QUARTER_TURN
        return tuple(
            Primitive(surface=rod_surface, size=size, friction=self.friction, place=place, turn=turn, thin=True)
            for place in places
        )
