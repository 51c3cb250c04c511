"""The order in which a GPU takes particles: neighbours in space next to each other, along Morton's curve."""

from typing import TypeVar

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Int

TreeT = TypeVar("TreeT")

FINENESS = 8
"""Steps of the curve a cell: what shares a cell now shall mostly do so when the object has moved by half of one."""

_BITS = 10


def morton_order(x: Float[jax.Array, "B N 3"], cell_m: float, bodies: tuple[int, ...]) -> Int[jax.Array, "B N"]:
    """Permutation of each candidate's particles into the order of the curve, one body after the other.

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


@jax.custom_vjp
def reorder(tree: TreeT, order: Int[jax.Array, "B N"], back: Int[jax.Array, "B N"]) -> TreeT:
    """Leaves (B, N, ...) with their particles in that order; `back` is its inverse, which the adjoint takes."""
    del back

    def taken(leaf: jax.Array) -> jax.Array:
        return jnp.take_along_axis(leaf, order.reshape(*order.shape, *[1] * (leaf.ndim - 2)), axis=1)

    return jax.tree.map(taken, tree)


def _reordered_forward(tree: TreeT, order: jax.Array, back: jax.Array) -> tuple[TreeT, tuple[jax.Array, jax.Array]]:
    return reorder(tree, order, back), (order, back)


def _reordered_backward(orders: tuple[jax.Array, jax.Array], bars: TreeT) -> tuple[TreeT, None, None]:
    order, back = orders
    return reorder(bars, back, order), None, None


reorder.defvjp(_reordered_forward, _reordered_backward)
