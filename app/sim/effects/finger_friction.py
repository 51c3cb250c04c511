"""Friction between object and tool: tangential carry along the finger, rotation of the object.

Coulomb's law (1785) with a coefficient of its own, because a polished finger and a table have little in common;
strongly nonlinear in pushing data.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import NOT_CLOTH, Effect, ParticleContext
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect, RodProperties

NOMINAL = wp.constant(0.3)
"""Coulomb coefficient of the bare finger; the friction of other tools is scaled by the same factor."""


@wp.func
def scaled_friction(mu: float, _grain: ParticleContext, phi: Any, at: int) -> float:
    """A tool's coefficient, times how much more than nominal the finger's is."""
    return mu * phi[at] / NOMINAL


def scaled_finger(rods: RodProperties, _context: RodContext, phi: EffectParameters) -> RodProperties:
    """The finger's coefficient, likewise."""
    return rods._replace(finger_friction=rods.finger_friction * (phi[:, 0] / NOMINAL))


EFFECT = Effect(
    objects=NOT_CLOTH,
    parameters=(
        ParameterSpec(
            name="finger_friction",
            unit="1",
            nominal=0.3,
            low=0.01,
            high=1.5,
            typical=0.6,
            scale="log",
            about="Coulomb friction coefficient between the object and the finger.",
            null_prior=(0.0, 0.2),
            rod_null_prior=(0.195, 0.26),
            liquid_null_prior=(-0.41, 0.35),
        ),
    ),
    tool_friction=scaled_friction,
    rod=RodEffect(properties=scaled_finger),
)
