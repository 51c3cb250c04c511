"""A flat finger: an upright plate with round edges whose lower end is the tool position, moved along x, y and z."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

from dataclasses import dataclass
from math import cos, sin
from typing import final

import warp as wp

from app.sim.constants import Shape
from app.sim.contact import sigmoid
from app.sim.tools.base import AXIS, Motion, Primitive


@wp.func
def flat_finger_surface(s: Shape, p: wp.vec3):
    """Surface as a finger's, about a line along x of the half length in the last of `size`."""
    x = p[0] - wp.clamp(p[0], -s.size[3], s.size[3])
    distance = wp.sqrt(x * x + p[1] * p[1] + AXIS * AXIS)
    cover = sigmoid((p[2] + s.size[1]) / s.size[2])
    return wp.vec3(x / distance, p[1] / distance, 0.0), distance - s.size[0], cover


@final
@dataclass(frozen=True, kw_only=True)
class FlatFinger:
    """Within `radius_m` of a level line, `half_width_m` to either side of its middle and at `yaw_rad` from the x axis.

    Contact ends `below_m` under its tip, over a width of `fade_m`.
    """

    radius_m: float
    half_width_m: float
    yaw_rad: float = 0.0
    friction: float = 0.3
    below_m: float = 0.003
    fade_m: float = 0.002
    motion: Motion = "slides"

    def primitives(self) -> tuple[Primitive, ...]:
        """One."""
        size = (self.radius_m, self.below_m, self.fade_m, self.half_width_m)
        turn = (cos(self.yaw_rad / 2), 0.0, 0.0, sin(self.yaw_rad / 2))
        return (Primitive(surface=flat_finger_surface, size=size, friction=self.friction, turn=turn),)
