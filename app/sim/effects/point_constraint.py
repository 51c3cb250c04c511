"""Point constraint (a pin, a snag): matter near (x, y) is held, dv/dt = -k h(r) v with h = (1 + r^2 / w^2)^-2.

A constraint by penalisation of the velocity (Angot, Bruneau and Fabrie 1999, "A penalization method to take into
account obstacles in incompressible viscous flows", eq. 3), integrated implicitly so that no rate can reverse motion.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import SOLIDS, Effect, NodeContext, place
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import RodEffect

WIDTH = wp.constant(0.015)
"""Radius of the held spot [m], about one cell."""


@wp.func
def held_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep in which the spot holds."""
    x, y = (node.x[0] - phi[at + 1]) / WIDTH, (node.x[1] - phi[at + 2]) / WIDTH
    far = 1.0 + x * x + y * y
    return v / (1.0 + phi[at] * node.dt / (far * far))


EFFECT = Effect(
    objects=SOLIDS,
    parameters=(
        ParameterSpec(
            name="constraint_rate",
            unit="1/s",
            nominal=0.0,
            low=0.0,
            high=2000.0,
            typical=300.0,
            scaling=(1, -1),
            scale="linear",
            about="Rate at which a spot holds what moves over it.",
            rod_null_prior=(0.0, 0.563),
        ),
        *place("constraint", "the spot that holds"),
    ),
    switches=1,
    reach_m=0.05,
    node_velocity=held_velocity,
    rod=RodEffect(
        velocity=f"""
        const T dx = (x - phi[1]) / {WIDTH}f, dy = (y - phi[2]) / {WIDTH}f, far = 1.0f + dx * dx + dy * dy;
        const T slower = 1.0f + k.dt * phi[0] / (far * far);
        vx /= slower; vy /= slower;
        """
    ),
)
