"""Maxwell solid (stress relaxation, creep): the deviatoric stress decays at the rate r, ds/dt = -r s.

Simo and Hughes 1998, "Computational Inelasticity", section 10.1, with no elastic rest; a step of backward Euler keeps
1 / (1 + r dt). What was bent stays bent in part, the more the longer it is held.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import ROPES, Effect, ParticleContext
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import RodEffect


@wp.func
def relaxed_share(kept: float, grain: ParticleContext, phi: Any, at: int) -> float:
    """The share that is left after one substep."""
    return kept / (1.0 + phi[at] * grain.dt)


EFFECT = Effect(
    objects=ROPES,
    parameters=(
        ParameterSpec(
            name="relaxation_rate",
            unit="1/s",
            nominal=0.0,
            low=0.0,
            high=50.0,
            typical=5.0,
            scaling=(-1, 0),
            scale="linear",
            about="Rate at which the stress of a deformed solid decays.",
            null_prior=(0.0, 0.3),
            rod_null_prior=(0.004, 0.468),
        ),
    ),
    spelling=("maxwell", "Maxwell relaxation"),
    kept=relaxed_share,
    rod=RodEffect(bend="e *= phi[0];", numbers=lambda phi, rods: 1 / (1 + phi * rods.scene.dt_s)),
)
