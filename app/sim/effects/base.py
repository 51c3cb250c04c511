"""What an effect file has to offer: a module-level `EFFECT`."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, TypeAlias, final

from app.sim.parameter import ParameterSpec

NodeFunction: TypeAlias = Callable[..., Any]
"""A Warp function of a grid node."""


@final
@dataclass(frozen=True, kw_only=True)
class Effect:
    """A physical term that vanishes where its parameters have their nominal (null) values.

    `parameters` are appended to phi. `node_velocity(v, x, dt, phi, at) -> v` is a Warp function that is applied to the
    velocity [m/s] of every grid node at position `x` [m], after gravity and before the table; the effect finds its own
    parameters at `phi[at]`, `phi[at + 1]`, .... Warp differentiates it, so it has to be smooth at the null values.
    """

    parameters: tuple[ParameterSpec, ...]
    node_velocity: NodeFunction
