"""Air draught: a level pull f g h(z) on what stands out of the table's boundary layer, h = min(1, z / D)^2.

Drag goes with the square of the air's speed, which grows linearly with height in a boundary layer (Blasius 1908), here
5 sqrt(nu x / U) = 2 cm thick after 0.3 m at 0.3 m/s. A share f of weight: for light cloth 0.1 at 0.5 m/s.
"""

# As static types, Warp's numbers have no operators.
# pyright: reportOperatorIssue=false

from typing import Any

import warp as wp

from app.sim.effects.base import Effect, Node
from app.sim.parameter import ParameterSpec

LAYER = wp.constant(0.02)
"""Thickness D of the boundary layer [m]."""


@wp.func
def blown_velocity(v: wp.vec3, node: Node, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep in the wind."""
    height = wp.clamp(node.x[2] / LAYER, 0.0, 1.0)
    push = node.gravity * node.dt * height * height
    return v + wp.vec3(push * phi[at], push * phi[at + 1], 0.0)


EFFECT = Effect(
    parameters=(
        ParameterSpec(
            name="draught_x",
            unit="1",
            nominal=0.0,
            low=-0.5,
            high=0.5,
            typical=0.1,
            scale="linear",
            about="Pull of a draught along x, as a share of weight.",
        ),
        ParameterSpec(
            name="draught_y",
            unit="1",
            nominal=0.0,
            low=-0.5,
            high=0.5,
            typical=0.1,
            scale="linear",
            about="Pull of a draught along y, as a share of weight.",
        ),
    ),
    node_velocity=blown_velocity,
)
