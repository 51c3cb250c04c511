"""Viscosity of a liquid beyond its material's: a stress 2 eta D, the same at all shear rates.

Newton's law (Batchelor 1967, "An Introduction to Fluid Dynamics", section 3.3). Oil has 0.1 Pa s, honey 2 to 10. Cells
damp flow as some of it would, so that thin liquids look alike; the range ends where explicit time steps do,
eta < density cell^2 / (4 dt).
"""

from typing import Any

import warp as wp

from app.sim.effects.base import LIQUIDS, Effect, ParticleContext, linear


@wp.func
def thickened_viscosity(viscosity: float, grain: ParticleContext, phi: Any, at: int) -> float:
    """The viscosity; that of solids is their own."""
    return viscosity + phi[at] * grain.fluid


EFFECT = Effect(
    objects=LIQUIDS,
    parameters=(
        linear(
            "liquid_viscosity",
            "Pa s",
            (0.0, 2.0, 10.0),
            "Viscosity of the liquid beyond that of water.",
            liquid_null_prior=(0.2, 0.16),
        ),
    ),
    viscosity=thickened_viscosity,
)
