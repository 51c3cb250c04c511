"""Friction drift: mu (1 + d t) over a session, t from -0.5 at its beginning to 0.5 at its end.

The first term of wear, dirt, drying or polishing; surfaces under repeated pushes do it (Yu et al. 2016, "More than a
million ways to be pushed", on changes of friction over time). Where the time is unknown it is 0, and nothing changes.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import SOLIDS, Effect, NodeContext
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect, RodProperties


@wp.func
def drifted_friction(mu: float, node: NodeContext, phi: Any, at: int) -> float:
    """The coefficient at this time of the session."""
    return mu * (1.0 + phi[at] * node.time)


def drifted_table(rods: RodProperties, context: RodContext, phi: EffectParameters) -> RodProperties:
    """The same of a rod's table."""
    return rods._replace(table_friction=rods.table_friction * (1 + phi[:, 0] * context.setting.session_time))


EFFECT = Effect(
    objects=SOLIDS,
    parameters=(
        ParameterSpec(
            name="friction_drift",
            unit="1/session",
            nominal=0.0,
            low=-1.0,
            high=1.0,
            typical=0.4,
            scale="linear",
            about="Change of the table's friction from the beginning to the end of the session, as a share of it.",
            rod_null_prior=(0.016, 0.055),
        ),
    ),
    table_friction=drifted_friction,
    rod=RodEffect(properties=drifted_table),
)
