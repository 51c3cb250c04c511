"""Friction map (place-dependent, heterogeneous friction): mu (1 + g . (x - x0)), at least a twentieth of mu.

The first term of the map of a table that is dusty, worn or damp on one side (Zmitrowicz 2006, "Models of kinematics
dependent anisotropic and heterogeneous friction"; measured places differ by 10 to 30 %, Ma and Rodriguez 2018).
"""

# As static types, Warp's vectors have no operators.
# pyright: reportOperatorIssue=false

from typing import Any

import warp as wp

from app.sim.effects.base import MIDDLE, MIDDLE_M, ON_TABLES, Effect, NodeContext
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import RodEffect

X0 = wp.constant(MIDDLE_M[0])
"""x of the reference point [m], where mu is phi's: the middle of the workspace, at y = 0."""

LEAST = wp.constant(0.05)
"""Friction does not fall below this share: it cannot push."""


@wp.func
def placed_friction(mu: float, node: NodeContext, phi: Any, at: int) -> float:
    """The coefficient at the node's place."""
    return mu * wp.max(LEAST, 1.0 + phi[at] * (node.x[0] - X0) + phi[at + 1] * node.x[1])


EFFECT = Effect(
    objects=ON_TABLES,
    parameters=tuple(
        ParameterSpec(
            name=f"friction_slope_{axis}",
            unit="1/m",
            nominal=0.0,
            low=-3.0,
            high=3.0,
            typical=1.0,
            scale="linear",
            about=f"Relative growth of the table's friction along {axis}, from {MIDDLE}.",
            null_prior=(0.0, 0.12),
            rod_null_prior=(0.0, 0.138),
        )
        for axis in "xy"
    ),
    table_friction=placed_friction,
    rod=RodEffect(friction=f"mu *= larger(all_of({LEAST}f), 1.0f + phi[0] * (x - {X0}f) + phi[1] * y);"),
)
