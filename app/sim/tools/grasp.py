"""A grasp: matter between a gripper's fingers when they close moves with them, and is released when they open.

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
"""Share of the reach over which it fades, so that the gradient sees matter just out of reach."""


@wp.func
def reach_surface(s: Shape, p: wp.vec3):
    """Ellipsoid of the half axes `size`, without a contact surface: matter inside is held from all sides."""
    scaled = wp.vec3(p[0] / s.size[0], p[1] / s.size[1], p[2] / s.size[2])
    away = wp.sqrt(wp.dot(scaled, scaled) + AXIS)
    return wp.vec3(), 0.0, sigmoid((1.0 - away) / _FADE)


@final
@dataclass(frozen=True, kw_only=True)
class Grasp:
    """Grasp of matter within `reach_m` of the tool position, along x, y and z, while it opens less than `closed_m`."""

    reach_m: Vector
    closed_m: float
    motion: Motion = "opens"

    def primitives(self) -> tuple[Primitive, ...]:
        """One."""
        return (Primitive(surface=reach_surface, size=(*self.reach_m, self.closed_m), friction=0.0, grasps=True),)
