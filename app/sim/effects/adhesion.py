"""Adhesion (suction, capillary or tacky contact): tools hold what leaves them with a traction of up to s [Pa].

Constant up to separation, as in the cohesive zone of Dugdale that Maugis 1992 puts between the limits of adhesive
contact ("Adhesion of spheres: the JKR-DMT transition using a Dugdale model"). Matter follows the finger on retreat.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import NOT_CLOTH, Effect, NodeContext
from app.sim.parameter import ParameterSpec


@wp.func
def sticky_traction(traction: float, _node: NodeContext, phi: Any, at: int) -> float:
    """The traction with the tool's."""
    return traction + phi[at]


EFFECT = Effect(
    objects=NOT_CLOTH,
    parameters=(
        ParameterSpec(
            name="adhesion",
            unit="Pa",
            nominal=0.0,
            low=0.0,
            high=2000.0,
            typical=500.0,
            scaling=(0, -1),
            scale="linear",
            about="Traction with which a tool holds matter that leaves it.",
            liquid_null_prior=(0.05, 0.29),
        ),
    ),
    adhesion=sticky_traction,
)
