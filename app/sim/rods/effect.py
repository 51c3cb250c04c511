"""Action of an effect on rods: on what is constant through an action, and by laws that depend on place and motion."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, TypeAlias, final

import jax
import jax.numpy as jnp
from jaxtyping import Float

from app.sim.rods.scene import RodScene


@final
class RodProperties(NamedTuple):
    """Properties of B rods of n nodes that stay the same through an action; a JAX pytree."""

    mass: Float[jax.Array, "B n"]
    """Mass of each node [kg]."""
    rigidity: Float[jax.Array, "B n"]
    """Bending rigidity E I at each node [N m^2]."""
    rest_curvature: Float[jax.Array, "B n"]
    """[1/m], positive to the left of the nodes' order."""
    table_friction: Float[jax.Array, " B"]
    finger_friction: Float[jax.Array, " B"]
    viscosity: Float[jax.Array, " B"]
    """Viscosity in bending [N m^2 s]."""
    yield_curvature: Float[jax.Array, " B"]
    """[1/m]."""
    permanent_set: Float[jax.Array, " B"]
    """Share of bends that lasts."""


@final
class RodSetting(NamedTuple):
    """Knowledge about an action besides its state, for effects; a JAX pytree. Nothing is differentiated by it."""

    material_coordinates: Float[jax.Array, "B n"]
    """Material coordinates of the nodes, from -1 at the object's first end to 1; 0 if the first end is unknown."""
    session_time: Float[jax.Array, " B"]
    """Session time of the action: -0.5 at the session's beginning, 0.5 at its end."""

    @classmethod
    def unknown(cls, candidates: int, nodes: int) -> "RodSetting":
        """The middle of everything: effects that depend on it do nothing."""
        return cls(material_coordinates=jnp.zeros((candidates, nodes)), session_time=jnp.zeros(candidates))


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class RodContext:
    """The rods as an effect sees them: their scene, and the action's setting."""

    scene: RodScene
    setting: RodSetting

    @property
    def direction(self) -> Float[jax.Array, "B 1"]:
        """1 where the nodes are in the order of the object, -1 where they are in the other, 0 where that is unknown."""
        along = self.setting.material_coordinates
        return jnp.sign(along[:, -1:] - along[:, :1])

    def section_mean(self, of: Callable[[jax.Array], jax.Array]) -> jax.Array:
        """Mean of a function of the height above the table [m] over the rope's round cross section.

        By Gauss and Chebyshev's quadrature, exact up to degree 31 (Abramowitz and Stegun 1964, 25.4.40).
        """
        angle = jnp.pi * jnp.arange(1, _SHARES + 1) / (_SHARES + 1)
        shares = 2 / (_SHARES + 1) * jnp.sin(angle) ** 2
        return (shares * of(self.scene.radius_m * (1 + jnp.cos(angle)))).sum()


_SHARES = 16

EffectParameters: TypeAlias = Float[jax.Array, "B P"]
"""Parameters of one effect: a row a candidate, a column a parameter."""


def own_parameters(phi: EffectParameters, _context: RodContext) -> EffectParameters:
    """The effect's parameters themselves."""
    return phi


@final
@dataclass(frozen=True, kw_only=True)
class RodEffect:
    """Action of an effect on rods, in SI units without any scaling.

    `properties(properties, context, phi)` returns what the effect's parameters phi (B, P) make of properties.

    The rest are laws for each node and time step: C++ statements on numbers of the type T, which has derivatives:
    +, -, *, /, `root`, `exponential`, `larger`, `smaller` (both of their arguments are numbers: `all_of(0.5f)` is a
    constant), `either(a < b, one, other)`. They see `phi[0]`, `phi[1]`, ..., one a parameter, and constants `k`: `k.dt`
    [s], `k.gravity` [m/s^2]. They must be smooth at the null, and change nothing there.
    """

    properties: Callable[[RodProperties, RodContext, jax.Array], RodProperties] | None = None
    velocity: str = ""
    """Changes `vx`, `vy` [m/s]: the velocity of a node at `x`, `y` [m] after a step of all forces."""
    friction: str = ""
    """Changes `mu`: the table's coefficient under a node at `x`, `y` [m] that moves with `vx`, `vy` [m/s]."""
    bend: str = ""
    """Changes `e`: the elastic part of the angle [rad] at a node, once a step; what it loses lasts."""
    lightens: bool = False
    """True if it may make nodes lighter than the scene's, which limits the time step."""
    numbers: Callable[[jax.Array, RodContext], jax.Array] = own_parameters
    """The numbers `phi` of the laws (B, P), as many as parameters, from these and the context.

    What is constant, such as a sine, is computed here.
    """

    @property
    def has_law(self) -> bool:
        """True where any of it is compiled."""
        return bool(self.velocity or self.friction or self.bend)
