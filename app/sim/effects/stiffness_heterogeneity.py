"""Stiffness heterogeneity: E(s) = E exp(h1 s + h2 (3 s^2) / 2) along the object, s from -1 to 1.

The first Legendre polynomials, less their value in the middle, of the logarithm, which keeps E positive (expansions of
random fields: Ghanem and Spanos 1991, "Stochastic Finite Elements", ch. 2): a worn end, a knot, a splice.
"""

from typing import Any

import jax.numpy as jnp
import warp as wp

from app.sim.effects.base import ROPES, Effect, ParticleContext, linear
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect, RodProperties


@wp.func
def varied_stiffness(E: float, grain: ParticleContext, phi: Any, at: int) -> float:
    """Young's modulus at the particle's place along the object."""
    s = grain.label[0]
    return E * wp.exp(s * (phi[at] + 1.5 * phi[at + 1] * s))


def varied_rods(rods: RodProperties, context: RodContext, phi: EffectParameters) -> RodProperties:
    """The bending rigidities of a rod's nodes."""
    s = context.setting.material_coordinates
    return rods._replace(rigidity=rods.rigidity * jnp.exp(s * (phi[:, :1] + 1.5 * phi[:, 1:] * s)))


_END = "Logarithm of the stiffness at the object's far end over that in its middle."
_BOTH = "Two thirds of the logarithm of the stiffness at both ends over that in the middle."
_USUAL = (0.0, 0.17)
EFFECT = Effect(
    objects=ROPES,
    parameters=(
        linear("stiffness_slope", "1", (-1.0, 0.5, 1.0), _END, null_prior=_USUAL, rod_null_prior=(0.0, 0.237)),
        linear("stiffness_bow", "1", (-0.7, 0.4, 0.7), _BOTH, null_prior=_USUAL, rod_null_prior=(0.033, 0.288)),
    ),
    odd=("stiffness_slope",),
    stiffness=varied_stiffness,
    rod=RodEffect(properties=varied_rods),
)
