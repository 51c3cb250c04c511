"""Mass heterogeneity: m(s) = m exp(h1 s + h2 (3 s^2) / 2) along the object, s from -1 to 1.

As for stiffness: Legendre polynomials, less their value in the middle, of the logarithm (Ghanem and Spanos 1991,
"Stochastic Finite Elements", ch. 2). A heavy end, a weight at the middle: the centre of rotation shifts.
"""

from typing import Any

import jax.numpy as jnp
import warp as wp

from app.sim.effects.base import ROPES, Effect, ParticleContext, linear
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect, RodProperties


@wp.func
def varied_mass(mass: float, grain: ParticleContext, phi: Any, at: int) -> float:
    """The mass at the particle's place along the object."""
    s = grain.label[0]
    return mass * wp.exp(s * (phi[at] + 1.5 * phi[at + 1] * s))


def varied_rods(rods: RodProperties, context: RodContext, phi: EffectParameters) -> RodProperties:
    """The masses of a rod's nodes."""
    s = context.setting.material_coordinates
    return rods._replace(mass=rods.mass * jnp.exp(s * (phi[:, :1] + 1.5 * phi[:, 1:] * s)))


_END = "Logarithm of the mass per length at the object's far end over that in its middle."
_BOTH = "Two thirds of the logarithm of the mass per length at both ends over that in the middle."
_USUAL = (0.0, 0.5)
EFFECT = Effect(
    objects=ROPES,
    parameters=(
        linear("mass_slope", "1", (-0.7, 0.35, 0.7), _END, null_prior=_USUAL, rod_null_prior=(0.0, 0.16)),
        linear("mass_bow", "1", (-0.5, 0.25, 0.5), _BOTH, null_prior=_USUAL, rod_null_prior=(0.21, 0.446)),
    ),
    odd=("mass_slope",),
    mass=varied_mass,
    rod=RodEffect(properties=varied_rods, lightens=True),
)
