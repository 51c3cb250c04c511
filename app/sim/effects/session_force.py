"""A push that grows in the course of a session: f / (m g) = t k, t from -0.5 at its beginning to 0.5 at its end.

The first term of a force that is not the same all day (Taylor 1715), as a fan that runs up. A library for what no cause
of the catalogue explains, and no cause itself: see `discovery/unexplained/formula.py`. Where the
time is unknown it does nothing.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import Effect, NodeContext
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import RodEffect


@wp.func
def growing_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep of the push."""
    push = node.gravity * node.dt * node.time
    return v + wp.vec3(push * phi[at], push * phi[at + 1], 0.0)


def _growth(axis: str) -> ParameterSpec:
    return ParameterSpec(
        name=f"growth_{axis}",
        unit="1/session",
        nominal=0.0,
        low=-1.0,
        high=1.0,
        typical=0.2,
        scale="linear",
        about=f"Change of a push along {axis} from the beginning to the end of the session, as a share of weight.",
        rod_null_prior=(0.0, 0.027),
    )


EFFECT = Effect(
    parameters=(_growth("x"), _growth("y")),
    catalogued=False,
    node_velocity=growing_velocity,
    rod=RodEffect(
        velocity="vx += k.gravity * k.dt * phi[0]; vy += k.gravity * k.dt * phi[1];",
        numbers=lambda phi, rods: phi * rods.setting.session_time[:, None],
    ),
)
