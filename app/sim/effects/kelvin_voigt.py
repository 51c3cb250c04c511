"""Kelvin-Voigt solid (internal damping): a viscous stress 2 eta D besides the elastic one.

Christensen 1982, "Theory of Viscoelasticity", section 1.5. It resists fast deformation and leaves slow shapes alone.
The range ends where explicit time steps do, eta < density cell^2 / (4 dt).
"""

from typing import Any

import warp as wp

from app.sim.effects.base import ROPES, Effect, ParticleContext
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect, RodProperties


@wp.func
def solid_viscosity(viscosity: float, grain: ParticleContext, phi: Any, at: int) -> float:
    """The viscosity; that of liquids is their own."""
    return viscosity + phi[at] * (1.0 - grain.fluid)


POISSON = 0.2
"""Poisson's ratio of ropes."""


def viscous_rods(rods: RodProperties, context: RodContext, phi: EffectParameters) -> RodProperties:
    """Viscosity of bending, I dE/dG eta: E depends on a shear modulus G as dE/dG = 2 + 4 nu^2 at constant lambda."""
    added = (2 + 4 * POISSON**2) * context.scene.second_moment_m4 * phi[:, 0]
    return rods._replace(viscosity=rods.viscosity + added)


EFFECT = Effect(
    objects=ROPES,
    parameters=(
        ParameterSpec(
            name="solid_viscosity",
            unit="Pa s",
            nominal=0.0,
            low=0.0,
            high=20.0,
            typical=10.0,
            scaling=(1, -1),
            scale="linear",
            about="Viscosity of a solid, beside its elasticity.",
            rod_null_prior=(-0.007, 1.893),
        ),
    ),
    spelling=("kelvin_voigt", "Kelvin\N{EN DASH}Voigt damping"),
    viscosity=solid_viscosity,
    rod=RodEffect(properties=viscous_rods),
)
