"""The state of the particles."""

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
    """Deformation gradient."""

    @classmethod
    def at_rest(cls, x: Float[jax.Array, "B N 3"]) -> Self:
        """Unmoving and undeformed at positions `x`."""
        x = jnp.asarray(x, jnp.float32)
        identity = jnp.broadcast_to(jnp.eye(3, dtype=x.dtype), (*x.shape, 3))
        return cls(x=x, v=jnp.zeros_like(x), C=jnp.zeros_like(identity), F=identity)
