"""Plastic yield: beyond a yield stress, given by its inverse c, a solid flows and stays; it keeps 1 / max(1, c |s|).

Von Mises' condition on the deviatoric stress s with radial return (Simo and Hughes 1998, "Computational Inelasticity",
box 9.1). The null is an infinite yield stress; near it, nothing happens until the stress reaches 1 / c.
"""

from math import sqrt
from typing import Any

import warp as wp

from app.sim.effects.base import ROPES, Effect, ParticleContext
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect, RodProperties


@wp.func
def yielded_share(kept: float, grain: ParticleContext, phi: Any, at: int) -> float:
    """The share that the yield surface leaves."""
    return kept / wp.max(1.0, phi[at] * grain.stress)


def yielding_rods(rods: RodProperties, context: RodContext, phi: EffectParameters) -> RodProperties:
    """The curvature at the fully plastic moment 4/3 r^3 sqrt(3/2) / c of a round rod (Hill 1950), whose own c adds."""
    middle = rods.rigidity[:, rods.rigidity.shape[1] // 2]
    share = phi[:, 0] * middle / (4 / 3 * sqrt(3 / 2) * context.scene.radius_m**3) * rods.yield_curvature
    return rods._replace(yield_curvature=rods.yield_curvature / (1 + share))


EFFECT = Effect(
    objects=ROPES,
    parameters=(
        ParameterSpec(
            name="yield_softness",
            unit="1/Pa",
            nominal=0.0,
            low=0.0,
            high=0.005,
            typical=0.001,
            scaling=(0, 1),
            scale="linear",
            about="One over the largest deviatoric stress that a solid bears without yielding.",
            null_prior=(0.0, 0.05),
            rod_null_prior=(0.404, 0.554),
        ),
    ),
    kept=yielded_share,
    rod=RodEffect(properties=yielding_rods),
)
