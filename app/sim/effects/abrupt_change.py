"""Abrupt change (change point): at the time t0 of a session, friction and stiffness become others.

Both times exp(a (S(t - t0) - S(-t0))) with a smooth step S from 0 to 1 (the change point of Page 1954, "Continuous
inspection schemes"). phi is that of the session's middle, t = 0: where the time is unknown, nothing changes.
"""

from typing import Any

import jax.numpy as jnp
import warp as wp

from app.sim.effects.base import SOLIDS, Effect, NodeContext, ParticleContext, linear
from app.sim.parameter import ParameterSpec
from app.sim.rods.effect import EffectParameters, RodContext, RodEffect, RodProperties

WIDTH = wp.constant(0.01)
"""Width of the step, in sessions: one action of a hundred."""


@wp.func
def rise(u: float) -> float:
    """Step from -0.5 to 0.5, rational, so that a distant t0 still has a derivative."""
    return 0.5 * u / (wp.abs(u) + WIDTH)


@wp.func
def changed_friction(mu: float, node: NodeContext, phi: Any, at: int) -> float:
    """The coefficient before or after the change."""
    return mu * wp.exp(phi[at] * (rise(node.time - phi[at + 2]) + rise(phi[at + 2])))


@wp.func
def changed_stiffness(E: float, grain: ParticleContext, phi: Any, at: int) -> float:
    """Young's modulus before or after the change."""
    return E * wp.exp(phi[at + 1] * (rise(grain.time - phi[at + 2]) + rise(phi[at + 2])))


def changed_rods(rods: RodProperties, context: RodContext, phi: EffectParameters) -> RodProperties:
    """The same of rods."""
    u = jnp.stack([context.setting.session_time - phi[:, 2], phi[:, 2]])
    factor = jnp.exp(phi[:, :2] * (0.5 * u / (jnp.abs(u) + WIDTH)).sum(0)[:, None])
    return rods._replace(table_friction=rods.table_friction * factor[:, 0], rigidity=rods.rigidity * factor[:, 1:])


_ENDS = (-1.0, 0.5, 1.0)
_LOG, _AFTER = "Logarithm of", "after the change over that before it."
_ABOUT = "When the change happens: -0.5 is the beginning and 0.5 the end of the session."
EFFECT = Effect(
    objects=SOLIDS,
    parameters=(
        linear("friction_step", "1", _ENDS, f"{_LOG} the table's friction {_AFTER}", rod_null_prior=(0.0, 0.044)),
        linear("stiffness_step", "1", _ENDS, f"{_LOG} the object's stiffness {_AFTER}", rod_null_prior=(0.0, 0.047)),
        ParameterSpec(name="step_time", unit="session", nominal=0.0, low=-0.5, high=0.5, scale="linear", about=_ABOUT),
    ),
    switches=2,
    table_friction=changed_friction,
    stiffness=changed_stiffness,
    rod=RodEffect(properties=changed_rods),
)
