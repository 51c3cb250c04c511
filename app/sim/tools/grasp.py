"""A grasp: what is between a gripper's fingers when they close goes with them, and is let go when they open.

Fingers that pick a cloth up pinch a fold of a few millimetres, which no grid of a planner resolves; what they do to
the rest is to hold it there. So this is the hold alone, without the fingers' bodies.
"""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

from dataclasses import dataclass
from typing import final

import warp as wp

from app.sim.constants import Shape
from app.sim.contact import sigmoid
from app.sim.tools.base import AXIS, Motion, Primitive, Vector

_FADE = wp.constant(0.1)
"""The reach ends over this share of itself, so that the gradient knows what is just out of reach."""


@wp.func
def reach_surface(s: Shape, p: wp.vec3):
    """An ellipsoid of the half axes `size`: no side is its surface, for what is inside is held from all."""
    scaled = wp.vec3(p[0] / s.size[0], p[1] / s.size[1], p[2] / s.size[2])
    away = wp.sqrt(wp.dot(scaled, scaled) + AXIS)
    return wp.vec3(), 0.0, sigmoid((1.0 - away) / _FADE)


@final
@dataclass(frozen=True, kw_only=True)
class Grasp:
    """Holds what is within `reach_m` of the tool position, along x, y and z, while it opens less than `closed_m`."""

    reach_m: Vector
    closed_m: float
    motion: Motion = "opens"

    def primitives(self) -> tuple[Primitive, ...]:
        """One."""
        return (Primitive(surface=reach_surface, size=(*self.reach_m, self.closed_m), friction=0.0, grasps=True),)
