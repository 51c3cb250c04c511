"""Effects outside the catalogue that own recordings can hide, written as effects of the simulator.

The same three forces as `app/rig/simulated/injected_effects` has in MuJoCo's terms: a quadratic drag, a pull across the
motion, a swirl about a point. On rods a pull across the motion is in proportion to speed far below 5 mm/s.
"""

# As static types, Warp's numbers and vectors have no operators.
# pyright: reportOperatorIssue=false

from typing import Any

import jax.numpy as jnp
import warp as wp

from app.sim.effects.base import Effect, NodeContext, place
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect

_REACH = wp.constant(0.02)
"""Height of a drag's reach above the table [m], about one rope diameter."""
_REST = wp.constant(0.025)
"""Far below this speed [m/s] a pull across the motion is in proportion to it: 5 mm/s in a world five times as fast."""


@wp.func
def dragged_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep of a = -q |v| v, integrated exactly."""
    nearness = wp.clamp(1.0 - node.x[2] / _REACH, 0.0, 1.0)
    speed = wp.sqrt(v[0] * v[0] + v[1] * v[1] + v[2] * v[2])
    return v / (1.0 + phi[at] * nearness * node.dt * speed)


@wp.func
def drifting_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep of a pull to the left of the motion, a share of weight."""
    speed = wp.sqrt(v[0] * v[0] + v[1] * v[1] + _REST * _REST)
    pull = phi[at] * node.gravity * node.dt / speed
    return v + wp.vec3(-pull * v[1], pull * v[0], 0.0)


@wp.func
def swirled_velocity(v: wp.vec3, node: NodeContext, phi: Any, at: int) -> wp.vec3:
    """The velocity after one substep of a pull round a point; in shares of weight a metre."""
    pull = phi[at] * node.gravity * node.dt
    return v + wp.vec3(pull * (phi[at + 2] - node.x[1]), pull * (node.x[0] - phi[at + 1]), 0.0)


def drag_on_section(phi: EffectParameters, rods: RodContext) -> EffectParameters:
    """The drag on a rod, as its cross section is near the table on average, times the length of a step."""
    return phi * rods.section_mean(lambda z: jnp.clip(1 - z / _REACH, 0, 1)) * rods.scene.dt_s


OUTSIDE = {
    "quadratic_drag": Effect(
        parameters=(
            ParameterSpec(
                name="quadratic_drag",
                unit="1/m",
                nominal=0.0,
                low=0.0,
                high=100.0,
                typical=20.0,
                scaling=(2, -1),
                scale="linear",
                about="Deceleration over the square of the speed, near the table.",
            ),
        ),
        node_velocity=dragged_velocity,
        rod=RodEffect(
            velocity="""
        const T kept = 1.0f / (1.0f + phi[0] * root(vx * vx + vy * vy + 1e-12f));
        vx *= kept; vy *= kept;
        """,
            numbers=drag_on_section,
        ),
    ),
    "sideways_drift": Effect(
        parameters=(
            ParameterSpec(
                name="sideways_drift",
                unit="1",
                nominal=0.0,
                low=-0.5,
                high=0.5,
                typical=0.15,
                scale="linear",
                about="Pull to the left of the motion, as a share of weight.",
            ),
        ),
        node_velocity=drifting_velocity,
        rod=RodEffect(
            velocity="""
        const T was = vx, pull = k.gravity * k.dt * phi[0] / root(vx * vx + vy * vy + 2.5e-5f);
        vx -= pull * vy; vy += pull * was;
        """
        ),
    ),
    "swirl": Effect(
        parameters=(
            ParameterSpec(
                name="swirl",
                unit="1/m",
                nominal=0.0,
                low=-2.0,
                high=2.0,
                typical=0.8,
                scale="linear",
                about="Pull round a point, as a share of weight, a metre from it.",
            ),
            *place("swirl", "the middle of the swirl"),
        ),
        switches=1,
        node_velocity=swirled_velocity,
        rod=RodEffect(
            velocity="""
        const T pull = k.gravity * k.dt * phi[0];
        vx += pull * (phi[2] - y); vy += pull * (x - phi[1]);
        """
        ),
    ),
}
"""Effects by name; typical sizes as in MuJoCo's world."""
