"""Shear thinning (power-law fluid): eta (g^2 / g0^2)^((n - 1) / 2) at the shear rate g, with index n.

Ostwald and de Waele (Bird, Armstrong and Hassager 1987, "Dynamics of Polymeric Liquids", eq. 4.1-10), and bounded at
rest. Sauces, paint and pulp: n = 0.3 to 0.9; phi's viscosity is that at g0 = 10 1/s.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import LIQUIDS, Effect, ParticleContext
from app.sim.parameter import ParameterSpec

REFERENCE = wp.constant(100.0)
"""g0^2 [1/s^2], of a slow pour."""

REST = wp.constant(0.1)
"""Added to g^2 [1/s^2]: below 0.3 1/s the fluid is Newtonian, and there is a derivative at rest."""


@wp.func
def thinned_viscosity(viscosity: float, grain: ParticleContext, phi: Any, at: int) -> float:
    """The viscosity at the particle's shear rate; that of solids is their own."""
    result = viscosity
    if grain.fluid > 0.0:
        result = viscosity * wp.pow((grain.shear + REST) / REFERENCE, 0.5 * (phi[at] - 1.0))
    return result


EFFECT = Effect(
    objects=LIQUIDS,
    parameters=(
        ParameterSpec(
            name="flow_index",
            unit="1",
            nominal=1.0,
            low=0.3,
            high=1.5,
            typical=0.6,
            scale="linear",
            about="Power of the shear rate with which a liquid's stress grows; below 1 it thins.",
        ),
    ),
    viscosity=thinned_viscosity,
)
