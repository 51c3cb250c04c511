"""A force that depends on motion alone: a = -c v - q |v| v + s g n x v / |v| + w n x v, of the level velocity v.

Drag by powers of speed (Newton 1687, "Principia", book II) and what pulls to the left of the way: as a nap or a thread
does, or in proportion to speed (Coriolis 1835). A library for what no cause of the catalogue explains, and no cause
itself: see `discovery/unexplained/formula.py`. Drag that does not grow with speed is the table's friction.
"""

# As static types, Warp's numbers have no operators.
# pyright: reportOperatorIssue=false

from typing import Any

import jax.numpy as jnp
import warp as wp

from app.sim.effects.base import Effect, NodeContext, linear
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect

REST = wp.constant(0.02)
"""Far below this speed [m/s] the pull to the left is in proportion to it."""


@wp.func
def moving_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep; drag and turn are integrated exactly, so that neither can run away."""
    speed = wp.sqrt(v[0] * v[0] + v[1] * v[1] + REST * REST)
    slowed = wp.exp(-phi[at] * node.dt) / (1.0 + phi[at + 1] * speed * node.dt)
    turn = (phi[at + 2] * node.gravity / speed + phi[at + 3]) * node.dt
    ahead, aside = slowed * wp.cos(turn), slowed * wp.sin(turn)
    return wp.vec3(ahead * v[0] - aside * v[1], ahead * v[1] + aside * v[0], v[2])


def rates_of_step(phi: EffectParameters, rods: RodContext) -> EffectParameters:
    """Parameters for rods: the share of velocity that drag leaves in a step, and the others unchanged."""
    return phi.at[:, 0].set(jnp.exp(-phi[:, 0] * rods.scene.dt_s))


_SQUARED = "Drag that grows with the square of speed."
_SIDEWAYS, _RATE = "Pull to the left of the way, as a share of weight.", "Pull to the left in proportion to speed."
EFFECT = Effect(
    parameters=(
        linear("drag", "1/s", (-10.0, 10.0, 50.0), "Drag in proportion to speed.", (1, -1), (-0.274, 0.148)),
        linear("drag_squared", "1/m", (-20.0, 20.0, 100.0), _SQUARED, (2, -1), (-0.009, 0.059)),
        linear("sideways", "1", (-0.5, 0.15, 0.5), _SIDEWAYS, rod_null_prior=(0.0, 0.011)),
        linear("sideways_rate", "1/s", (-50.0, 10.0, 50.0), _RATE, (1, -1), (0.0, 0.023)),
    ),
    catalogued=False,
    node_velocity=moving_velocity,
    rod=RodEffect(
        velocity=f"""
        const T speed = root(vx * vx + vy * vy + {REST * REST}f), was = vx;
        const T half = 0.5f * k.dt * (k.gravity * phi[2] / speed + phi[3]), square = half * half;
        const T slowed = phi[0] / (1.0f + k.dt * phi[1] * speed) / (1.0f + square);
        vx = slowed * ((1.0f - square) * vx - 2.0f * half * vy);
        vy = slowed * ((1.0f - square) * vy + 2.0f * half * was);
        """,
        numbers=rates_of_step,
    ),
)
