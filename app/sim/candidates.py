"""Masks of finite candidates in a batch, and replacement of the others. The first axis is the candidate."""

from functools import partial
from typing import Any, TypeVar

import jax
import jax.numpy as jnp
from jaxtyping import Bool

TreeT = TypeVar("TreeT")


@partial(jax.jit, inline=True)
def are_finite(*tree: Any) -> Bool[jax.Array, " B"]:
    """Mask of the candidates that are finite in every number of the arrays in `tree`."""
    flags = [jnp.isfinite(leaf).all(axis=tuple(range(1, leaf.ndim))) for leaf in jax.tree.leaves(tree)]
    return jnp.stack(flags).all(axis=0)


def where_finite(finite: Bool[jax.Array, " B"], tree: TreeT) -> TreeT:
    """`tree` with NaN in every number of a candidate that is not finite."""
    return jax.tree.map(partial(_mask, finite), tree)


def as_float32(leaf: jax.Array) -> jax.Array:
    """The same numbers in single precision."""
    return jnp.asarray(leaf, jnp.float32)


@partial(jax.jit, inline=True)
def _mask(finite: jax.Array, leaf: jax.Array) -> jax.Array:
    return jnp.where(finite.reshape(-1, *[1] * (leaf.ndim - 1)), leaf, jnp.nan)
