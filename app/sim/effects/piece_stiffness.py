"""Stiffness of pieces in a liquid over what the model has: Young's modulus of all of them, times a factor.

Hooke's law (Landau and Lifshitz 1986, "Theory of Elasticity", section 5). Pieces that lie before a lip dam what is
behind them until they give way: tofu has 5 to 20 kPa, cooked vegetables several times as much.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import SOUPS, Effect, ParticleContext
from app.sim.parameter import ParameterSpec


@wp.func
def stiffer_pieces(stiffness: float, grain: ParticleContext, phi: Any, at: int) -> float:
    """The modulus; that of liquids is their own."""
    result = stiffness
    if grain.fluid == 0.0:
        result = stiffness * phi[at]
    return result


EFFECT = Effect(
    objects=SOUPS,
    parameters=(
        ParameterSpec(
            name="piece_stiffness",
            unit="1",
            nominal=1.0,
            low=0.1,
            high=2.5,
            typical=0.4,
            scale="log",
            about="Stiffness of the pieces in a liquid, as a multiple of the model's.",
        ),
    ),
    stiffness=stiffer_pieces,
)
