"""Abrupt change (change point): at the time t0 of a session, friction and stiffness become others.

Both times exp(a (S(t - t0) - S(-t0))) with a smooth step S from 0 to 1 (the change point of Page 1954, "Continuous
inspection schemes"). phi is that of the session's middle, t = 0: where the time is unknown, nothing changes.
"""

from typing import Any

import warp as wp

from app.sim.effects.base import Effect, Grain, Node
from app.sim.parameter import ParameterSpec

WIDTH = wp.constant(0.01)
"""Of the step, in sessions: one action of a hundred."""


@wp.func
def rise(u: float) -> float:
    """From -0.5 to 0.5, rational, so that a distant t0 still has a derivative."""
    return 0.5 * u / (wp.abs(u) + WIDTH)


@wp.func
def changed_friction(mu: float, node: Node, phi: Any, at: int) -> float:
    """The coefficient before or after the change."""
    return mu * wp.exp(phi[at] * (rise(node.time - phi[at + 2]) + rise(phi[at + 2])))


@wp.func
def changed_stiffness(E: float, grain: Grain, phi: Any, at: int) -> float:
    """Young's modulus before or after the change."""
    return E * wp.exp(phi[at + 1] * (rise(grain.time - phi[at + 2]) + rise(phi[at + 2])))


def _log_step(name: str, of: str) -> ParameterSpec:
    about = f"Logarithm of {of} after the change over that before it."
    return ParameterSpec(name=name, unit="1", nominal=0.0, low=-1.0, high=1.0, typical=0.5, scale="linear", about=about)


EFFECT = Effect(
    parameters=(
        _log_step("friction_step", "the table's friction"),
        _log_step("stiffness_step", "the object's stiffness"),
        ParameterSpec(
            name="step_time",
            unit="session",
            nominal=0.0,
            low=-0.5,
            high=0.5,
            scale="linear",
            about="When the change happens: -0.5 is the beginning and 0.5 the end of the session.",
        ),
    ),
    switches=2,
    table_friction=changed_friction,
    stiffness=changed_stiffness,
)
