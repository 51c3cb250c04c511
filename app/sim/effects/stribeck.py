"""Stribeck effect (static above kinetic friction): mu (1 + r exp(-(v / v_s)^2)) at the sliding speed v.

Stribeck 1902, in the form of Armstrong-Helouvry, Dupont and Canudas de Wit 1994, "A survey of models, analysis tools
and compensation methods for the control of machines with friction", with exponent 2. Slow pushes stick, fast ones run.
"""

# As static types, Warp's vectors have no operators.
# pyright: reportOperatorIssue=false

from typing import Any

import warp as wp

from app.sim.effects.base import ON_TABLES, Effect, NodeContext
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import RodEffect


@wp.func
def stribeck_friction(mu: float, node: NodeContext, phi: Any, at: int) -> float:
    """The coefficient at the node's speed along the table."""
    slow = (node.v[0] * node.v[0] + node.v[1] * node.v[1]) / (phi[at + 1] * phi[at + 1])
    return mu * (1.0 + phi[at] * wp.exp(-slow))


EFFECT = Effect(
    objects=ON_TABLES,
    parameters=(
        ParameterSpec(
            name="stribeck_excess",
            unit="1",
            nominal=0.0,
            low=-0.5,
            high=2.0,
            typical=0.4,
            scale="linear",
            about="How much greater friction is at rest than when sliding, as a share of the latter.",
            rod_null_prior=(0.0, 0.174),
        ),
        ParameterSpec(
            name="stribeck_speed",
            unit="m/s",
            nominal=0.3,
            low=0.02,
            high=2.0,
            scaling=(-1, 0),
            scale="log",
            about="Sliding speed beyond which the excess is gone.",
        ),
    ),
    spelling=("stribeck", "Stribeck friction"),
    switches=1,
    table_friction=stribeck_friction,
    rod=RodEffect(friction="mu *= 1.0f + phi[0] * exponential(-(vx * vx + vy * vy) / (phi[1] * phi[1]));"),
)
