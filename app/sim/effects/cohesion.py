"""Cohesion of grains: they bear c [Pa] of shear and of tension beyond what friction gives them.

The c of Mohr and Coulomb; of moist grains, whose liquid bridges give 10 to 1000 Pa (Richefeu, El Youssoufi and Radjai
2006, "Shear strength properties of wet granular materials"). They move in clumps.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import GRAINS, Effect, ParticleContext
from app.sim.parameter import ParameterSpec


@wp.func
def added_cohesion(cohesion: float, _grain: ParticleContext, phi: Any, at: int) -> float:
    """The material's and this."""
    return cohesion + phi[at]


EFFECT = Effect(
    objects=GRAINS,
    parameters=(
        ParameterSpec(
            name="cohesion",
            unit="Pa",
            nominal=0.0,
            low=0.0,
            high=1000.0,
            typical=100.0,
            scaling=(0, -1),
            scale="linear",
            about="Cohesion of grains, beyond the material's own.",
        ),
    ),
    not_injectable="beans of this world do not stick together",
    cohesion=added_cohesion,
)
