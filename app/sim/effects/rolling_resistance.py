"""Rolling resistance: what no tool touches rolls and feels r of sliding friction, mu (1 - (1 - r) (1 - touched)).

What is pushed slides along the finger and the table; what runs on after the finger has stopped rolls. Coefficients of
rolling are 0.02 to 0.1 (Ai et al. 2011, "Assessment of rolling resistance models in discrete element simulations").
"""

from typing import Any

import warp as wp

from app.sim.effects.base import ON_TABLES, Effect, NodeContext
from app.sim.parameter import ParameterSpec


@wp.func
def rolling_friction(mu: float, node: NodeContext, phi: Any, at: int) -> float:
    """The coefficient of what rolls as far as no tool holds it."""
    return mu * (1.0 - (1.0 - phi[at]) * (1.0 - node.touched))


EFFECT = Effect(
    objects=ON_TABLES,
    parameters=(
        ParameterSpec(
            name="rolling_share",
            unit="1",
            nominal=1.0,
            low=0.02,
            high=1.0,
            typical=0.5,
            scale="linear",
            about="Resistance of matter that no tool touches, as a share of sliding friction; 1 does not roll.",
        ),
    ),
    table_friction=rolling_friction,
)
