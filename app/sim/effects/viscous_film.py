"""A viscous film on the table: near it, matter is slowed in proportion to its velocity, a = -c v.

Couette flow in a thin layer (Reynolds 1886, "On the theory of lubrication"). Unlike Coulomb friction it depends on
speed and not on weight: a wet or dusty table, a thin layer of oil.
"""

from typing import Any

import jax.numpy as jnp
import warp as wp

from app.sim.effects.base import SOLIDS, Effect, NodeContext
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect

FILM_REACH = wp.constant(0.02)
"""Height of the film's reach [m], about one rope diameter: lifted matter is free of it."""


@wp.func
def film_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep of drag, integrated exactly so that no drag can reverse it."""
    nearness = wp.clamp(1.0 - node.x[2] / FILM_REACH, 0.0, 1.0)
    return wp.exp(-phi[at] * nearness * node.dt) * v


def share_of_velocity(phi: EffectParameters, rods: RodContext) -> EffectParameters:
    """The share of its velocity that a rod keeps in a step: it is slowed as much as its cross section on average."""
    nearness = rods.section_mean(lambda z: jnp.clip(1 - z / FILM_REACH, 0, 1))
    return jnp.exp(-phi * nearness * rods.scene.dt_s)


EFFECT = Effect(
    objects=SOLIDS,
    parameters=(
        ParameterSpec(
            name="film_drag",
            unit="1/s",
            nominal=0.0,
            low=0.0,
            high=50.0,
            typical=10.0,
            scaling=(1, -1),
            scale="linear",
            about="Rate at which a viscous film slows what touches the table.",
            rod_null_prior=(0.339, 0.539),
        ),
    ),
    node_velocity=film_velocity,
    rod=RodEffect(velocity="vx *= phi[0]; vy *= phi[0];", numbers=share_of_velocity),
)
