"""The state of the particles, and what does not change while they move."""

from typing import NamedTuple, Self, final

import jax
import jax.numpy as jnp
from jaxtyping import Float


@final
class State(NamedTuple):
    """Particles of B candidates; a JAX pytree. B candidates, N particles."""

    x: Float[jax.Array, "B N 3"]
    """Positions [m]."""
    v: Float[jax.Array, "B N 3"]
    """Velocities [m/s]."""
    C: Float[jax.Array, "B N 3 3"]
    """Affine velocity field around each particle [1/s]."""
    F: Float[jax.Array, "B N 3 3"]
    """Deformation gradient; of a liquid diag(J, 1, 1), of a cloth its two threads and its normal as columns."""

    @classmethod
    def at_rest(cls, x: Float[jax.Array, "B N 3"]) -> Self:
        """Unmoving and undeformed at positions `x`."""
        x = jnp.asarray(x, jnp.float32)
        identity = jnp.broadcast_to(jnp.eye(3, dtype=x.dtype), (*x.shape, 3))
        return cls(x=x, v=jnp.zeros_like(x), C=jnp.zeros_like(identity), F=identity)

    @property
    def centreline(self) -> Float[jax.Array, "B 2 0"]:
        """Particles have none."""
        return jnp.zeros((len(self.x), 2, 0), jnp.float32)

    def resting(self) -> Self:
        """The same particles, unmoving and undeformed."""
        return self.at_rest(self.x)


@final
class Setting(NamedTuple):
    """Inputs of effects besides the state; a JAX pytree. Nothing is differentiated with respect to it."""

    label: Float[jax.Array, "B N 4"]
    """Particle coordinates in its object: along it (-1 to 1), offset from its middle [m], direction there (x, y).

    A direction of 0 is unknown; materials that need one estimate it (`directions`)."""
    time: Float[jax.Array, " B"]
    """Session time of the action: -0.5 at the session's beginning, 0.5 at its end."""

    @classmethod
    def unknown(cls, candidates: int, particles: int) -> Self:
        """The middle of everything: effects that depend on it do nothing."""
        return cls(label=jnp.zeros((candidates, particles, 4)), time=jnp.zeros(candidates))
