"""A finger: a vertical cylinder whose lower end is the tool position, moved along x, y and z."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

from dataclasses import dataclass
from typing import final

import warp as wp

from app.sim.constants import Shape
from app.sim.contact import sigmoid
from app.sim.tools.base import AXIS, Motion, Primitive


@wp.func
def finger_surface(s: Shape, p: wp.vec3):
    """The normal is level, because the table bears what a round tip presses down; below the tip contact fades."""
    distance = wp.sqrt(p[0] * p[0] + p[1] * p[1] + AXIS * AXIS)
    cover = sigmoid((p[2] + s.size[1]) / s.size[2])
    return wp.vec3(p[0] / distance, p[1] / distance, 0.0), distance - s.size[0], cover


@final
@dataclass(frozen=True, kw_only=True)
class FingerCollider:
    """Contact ends `below_m` under its tip, over a width of `fade_m`."""

    radius_m: float
    friction: float = 0.3
    below_m: float = 0.003
    fade_m: float = 0.002
    motion: Motion = "slides"

    def primitives(self) -> tuple[Primitive, ...]:
        """One."""
        size = (self.radius_m, self.below_m, self.fade_m, 0.0)
        return (Primitive(surface=finger_surface, size=size, friction=self.friction),)
