"""A hollow bowl of any thickness, which moves and rotates: a spherical shell cut off at its rim."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

from dataclasses import dataclass
from typing import Self, final

import warp as wp

from app.core.geometry.shapes.fixtures import Bowl
from app.core.geometry.shapes.tools import HeldBowl
from app.sim.constants import Shape
from app.sim.tools.base import AXIS, Motion, Primitive, Vector, safe_norm

_LOWERED = 0.24
"""Share of its radius by which the wall of a bowl that pours ends below its rim.

Matter points flow over a lip only when their level is 5 to 8 mm above it, on cells of 5 to 15 mm alike, and of water
all that is above the lip runs out (decision 39). With this share, bowls of 4 to 7.5 cm that are tilted slowly keep what
hydrostatics say to 3 to 7 % of the water (RMS) on a planner's cells and to 5 on the world's, and without it to 26 to
38 (`bench/lip.py`).
"""


@wp.func
def bowl_surface(s: Shape, p: wp.vec3):
    """Middle radius, half thickness, height of the rim over the sphere's centre, radius of the rim's circle."""
    level = wp.sqrt(p[0] * p[0] + p[1] * p[1] + AXIS * AXIS)
    radius = safe_norm(p)
    away = wp.vec3()
    distance = wp.float32(0.0)
    # Below the cone through the rim the shell is nearest, above it the rim.
    if p[2] * s.size[3] <= s.size[2] * level:
        distance = radius - s.size[0]
        away = wp.where(distance < 0.0, -1.0, 1.0) * p / radius
        distance = wp.abs(distance)
    else:
        rim = wp.vec3(p[0] * s.size[3] / level, p[1] * s.size[3] / level, s.size[2])
        distance = safe_norm(p - rim)
        away = (p - rim) / distance
    return away, distance - s.size[1], 1.0


@final
@dataclass(frozen=True, kw_only=True)
class BowlCollider:
    """Inner radius and wall; the rim is `rim_m` above the sphere's centre, which is the tool position.

    0 is half a sphere, more is deeper, less is shallower.
    """

    radius_m: float
    thickness_m: float = 0.008
    rim_m: float = 0.0
    place_m: Vector = (0.0, 0.0, 0.0)
    friction: float = 0.1
    motion: Motion = "turns"

    @classmethod
    def that_pours(cls, bowl: HeldBowl) -> Self:
        """The bowl in a hand, which turns: matter points run out of it at the tilts at which a liquid does."""
        return cls(
            radius_m=bowl.radius_m,
            thickness_m=bowl.thickness_m,
            friction=bowl.friction,
            rim_m=-_LOWERED * bowl.radius_m,
        )

    @classmethod
    def that_stands(cls, bowl: Bowl) -> Self:
        """The bowl on the table."""
        return cls(
            radius_m=bowl.radius_m,
            thickness_m=bowl.thickness_m,
            friction=bowl.friction,
            place_m=bowl.place_m,
            motion="fixed",
        )

    def primitives(self) -> tuple[Primitive, ...]:
        """One."""
        middle = self.radius_m + self.thickness_m / 2
        rim = (middle**2 - self.rim_m**2) ** 0.5
        size = (middle, self.thickness_m / 2, self.rim_m, rim)
        return (Primitive(surface=bowl_surface, size=size, friction=self.friction, place=self.place_m, thin=True),)
