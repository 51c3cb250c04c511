"""Hidden obstacle: a soft vertical post at (x, y) slows what approaches it, and lets go what leaves.

The normal velocity n of what comes closer decays, dv/dt = -k h(r) min(0, v . n) n, by penalisation (Angot, Bruneau and
Fabrie 1999, "A penalization method to take into account obstacles in incompressible viscous flows"), and implicitly.
"""

# As static types, Warp's vectors have no operators.
# pyright: reportArgumentType=false, reportCallIssue=false

from typing import Any

import warp as wp

from app.sim.effects.base import SOLIDS, Effect, NodeContext, place
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import RodEffect

RADIUS = wp.constant(0.02)
"""R of the post [m]: h = max(0, 1 - (r / 2 R)^2)^2 is a half near R and gone at twice that."""


@wp.func
def obstructed_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep in which the post resists; it has no normal within a tenth of R of its axis."""
    away = wp.vec3(node.x[0] - phi[at + 1], node.x[1] - phi[at + 2], 0.0) / RADIUS
    square = wp.dot(away, away)
    near = wp.max(0.0, 1.0 - 0.25 * square)
    resisted = phi[at] * node.dt * near * near
    return v - (resisted / (1.0 + resisted) * wp.min(0.0, wp.dot(v, away)) / (square + 0.01)) * away


EFFECT = Effect(
    objects=SOLIDS,
    parameters=(
        ParameterSpec(
            name="obstacle_rate",
            unit="1/s",
            nominal=0.0,
            low=0.0,
            high=5000.0,
            typical=1000.0,
            scaling=(1, -1),
            scale="linear",
            about="Rate at which a hidden post stops what approaches it.",
            rod_null_prior=(0.0, 0.462),
        ),
        *place("obstacle", "the hidden post"),
    ),
    switches=1,
    reach_m=0.045,
    node_velocity=obstructed_velocity,
    rod=RodEffect(
        velocity=f"""
        const T ax = (x - phi[1]) / {RADIUS}f, ay = (y - phi[2]) / {RADIUS}f, square = ax * ax + ay * ay;
        const T near = larger(all_of(0.0f), 1.0f - 0.25f * square), resisted = k.dt * phi[0] * near * near;
        const T stopped = resisted / (1.0f + resisted) * smaller(all_of(0.0f), vx * ax + vy * ay) / (square + 0.01f);
        vx -= stopped * ax; vy -= stopped * ay;
        """
    ),
)
