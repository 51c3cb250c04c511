"""Table tilt (gravity misalignment): weight pulls along the table, g (sin b, -sin a) for tilts a about x, b about y.

The inclined plane (Stevin 1586). A table on uneven feet, or a base that is not level: matter without friction drifts
although nothing touches it. Angles are small: sin a = a to 0.13 % at 5 degrees, and 0.4 % of the weight is lost.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import Effect, NodeContext
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import RodEffect

RADIANS = wp.constant(3.14159265 / 180.0)
"""A degree."""


@wp.func
def tilted_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep of the weight's part along the table."""
    pull = node.gravity * node.dt * RADIANS
    return v + wp.vec3(pull * phi[at + 1], -pull * phi[at], 0.0)


EFFECT = Effect(
    parameters=(
        ParameterSpec(
            name="tilt_x",
            unit="deg",
            nominal=0.0,
            low=-5.0,
            high=5.0,
            typical=1.0,
            scale="linear",
            about="Tilt of the table about x: positive raises its +y side.",
            rod_null_prior=(0.0, 0.06),
            liquid_null_prior=(0.0, 0.27),
        ),
        ParameterSpec(
            name="tilt_y",
            unit="deg",
            nominal=0.0,
            low=-5.0,
            high=5.0,
            typical=1.0,
            scale="linear",
            about="Tilt of the table about y: positive lowers its +x side.",
            rod_null_prior=(0.0, 0.06),
            liquid_null_prior=(0.0, 0.27),
        ),
    ),
    node_velocity=tilted_velocity,
    rod=RodEffect(
        velocity=f"const float pull = {RADIANS}f * k.gravity * k.dt; vx += pull * phi[1]; vy -= pull * phi[0];"
    ),
)
