"""Air draught: a level pull f g h(z) on what stands out of the table's boundary layer, h = min(1, z / D)^2.

Drag goes with the square of the air's speed, which grows linearly with height in a boundary layer (Blasius 1908), here
5 sqrt(nu x / U) = 2 cm thick after 0.3 m at 0.3 m/s. A share f of weight: for light cloth 0.1 at 0.5 m/s.
"""

# As static types, Warp's numbers have no operators.
# pyright: reportOperatorIssue=false

from typing import Any

import jax.numpy as jnp
import warp as wp

from app.sim.effects.base import SOLIDS, Effect, NodeContext, linear
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect

LAYER = wp.constant(0.02)
"""Thickness D of the boundary layer [m]."""


@wp.func
def blown_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep in the wind."""
    height = wp.clamp(node.x[2] / LAYER, 0.0, 1.0)
    push = node.gravity * node.dt * height * height
    return v + wp.vec3(push * phi[at], push * phi[at + 1], 0.0)


def pull_on_section(phi: EffectParameters, rods: RodContext) -> EffectParameters:
    """The shares of weight with which the wind pulls a rod: as its cross section on average."""
    return phi * rods.section_mean(lambda z: jnp.clip(z / LAYER, 0, 1) ** 2)


EFFECT = Effect(
    objects=SOLIDS,
    parameters=(
        linear(
            "draught_x",
            "1",
            (-0.5, 0.1, 0.5),
            "Pull of a draught along x, as a share of weight.",
            rod_null_prior=(0.0, 0.049),
        ),
        linear(
            "draught_y",
            "1",
            (-0.5, 0.1, 0.5),
            "Pull of a draught along y, as a share of weight.",
            rod_null_prior=(0.0, 0.049),
        ),
    ),
    node_velocity=blown_velocity,
    rod=RodEffect(
        velocity="vx += k.gravity * k.dt * phi[0]; vy += k.gravity * k.dt * phi[1];", numbers=pull_on_section
    ),
)
