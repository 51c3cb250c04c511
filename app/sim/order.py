"""The order in which a GPU takes particles: neighbours in space next to each other, along Morton's curve."""

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

FINENESS = 8
"""Steps of the curve a cell: what shares a cell now shall mostly do so when the object has moved by half of one."""

_BITS = 10


def morton_order(x: Float[jax.Array, "B N 3"], cell_m: float, bodies: tuple[int, ...]) -> Int[jax.Array, "B N"]:
    """For each candidate the particles' numbers in the order of the curve, one body after the other.

    `bodies`: how many particles each has. Positions beyond 2^10 steps of the curve share its ends.
    """
    low = x.min(axis=1, keepdims=True)
    steps = jnp.clip((x - low) * (FINENESS / cell_m), 0, 2**_BITS - 1)
    spread = jnp.where(jnp.isfinite(steps), steps, 0).astype(jnp.uint32)
    for shift, mask in ((16, 0x030000FF), (8, 0x0300F00F), (4, 0x030C30C3), (2, 0x09249249)):
        spread = (spread | (spread << shift)) & mask
    code = (spread[..., 0] << 2) | (spread[..., 1] << 1) | spread[..., 2]
    body = jnp.asarray(np.repeat(np.arange(len(bodies)), bodies), jnp.int32)
    return jnp.lexsort((code, jnp.broadcast_to(body, code.shape)), axis=-1)
