"""Rest curvature (intrinsic curvature, coil memory): without load a rope is curved by k to its left.

Elastic deformation F_e = F G^-1, where growth G shortens fibres on the inner side, G^-1 = I + k o t t^T to first order
for a fibre along t at the offset o to the left of the middle line (Rodriguez, Hoger and McCulloch 1994, "Stress-
dependent finite growth in soft elastic tissues", eq. 3; of rods Bergou et al. 2008, "Discrete elastic rods").
"""

# As static types, Warp's vectors have no operators.
# pyright: reportArgumentType=false

from typing import Any

import warp as wp

from app.sim.effects.base import ROPES, Effect, ParticleContext
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect, RodProperties


@wp.func
def curved_rest(F: wp.mat33, grain: ParticleContext, phi: Any, at: int) -> wp.mat33:
    """The deformation from the curved shape."""
    t = wp.vec3(grain.label[2], grain.label[3], 0.0)
    return F + (phi[at] * grain.label[1]) * wp.outer(F * t, t)


def curved_rods(rods: RodProperties, context: RodContext, phi: EffectParameters) -> RodProperties:
    """The rest curvature of rods, whose nodes may be in either order."""
    return rods._replace(rest_curvature=rods.rest_curvature + phi * context.direction)


EFFECT = Effect(
    objects=ROPES,
    parameters=(
        ParameterSpec(
            name="rest_curvature",
            unit="1/m",
            nominal=0.0,
            low=-15.0,
            high=15.0,
            typical=4.0,
            scale="linear",
            about="Curvature of the unloaded object, positive to the left of its direction.",
            rod_null_prior=(0.0, 0.269),
        ),
    ),
    rest=curved_rest,
    needs_orientation=True,
    odd=("rest_curvature",),
    rod=RodEffect(properties=curved_rods),
)
