"""Point attraction (a magnet, a dip in the table): a = 2 A g w d / (d^2 + w^2) towards (x, y) at the distance d.

The field 1/d of a line source, softened as by Plummer (1911, "On the problem of distribution in globular star
clusters"): largest, A g, at the distance w, and felt far away. A share A of weight, so that it scales with gravity.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import SOLIDS, Effect, NodeContext, place
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import RodEffect

WIDTH = wp.constant(0.05)
"""Distance [m] at which it pulls most."""


@wp.func
def attracted_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep of the pull."""
    x, y = (phi[at + 1] - node.x[0]) / WIDTH, (phi[at + 2] - node.x[1]) / WIDTH
    pull = 2.0 * phi[at] * node.gravity * node.dt / (1.0 + x * x + y * y)
    return v + wp.vec3(pull * x, pull * y, 0.0)


EFFECT = Effect(
    objects=SOLIDS,
    parameters=(
        ParameterSpec(
            name="attraction",
            unit="1",
            nominal=0.0,
            low=-0.5,
            high=0.5,
            typical=0.1,
            scale="linear",
            about="Largest pull towards a point of the table, as a share of weight; negative pushes away.",
            rod_null_prior=(0.0, 0.101),
        ),
        *place("attraction", "the point that attracts"),
    ),
    switches=1,
    node_velocity=attracted_velocity,
    rod=RodEffect(
        velocity=f"""
        const T dx = (phi[1] - x) / {WIDTH}f, dy = (phi[2] - y) / {WIDTH}f;
        const T pull = 2.0f * k.gravity * k.dt * phi[0] / (1.0f + dx * dx + dy * dy);
        vx += pull * dx; vy += pull * dy;
        """
    ),
)
