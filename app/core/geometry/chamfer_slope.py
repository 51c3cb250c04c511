"""Chamfer distance of JAX arrays; its slope follows the nearest points, where that of JAX's minima takes all pairs."""

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float, Int

Nearest = tuple[Int[Array, "*batch N"], Int[Array, "*batch M"]]
"""Indices of the nearest point of the other set, of each point."""

_ROUNDED = 4
"""Units of rounding within which squared distances are equal."""


def chamfer_of_pairs_m2(x: Float[Array, "*#batch N 3"], y: Float[Array, "*#batch M 3"]) -> Float[Array, "*batch"]:
    """Symmetric squared Chamfer distance [m^2] over all pairs; leading axes are broadcast; differentiable in reverse.

    Where several points are equally near, the slope is by the first of them. NaN where a number of either cloud is.
    """
    leading = jnp.broadcast_shapes(x.shape[:-2], y.shape[:-2])
    return _chamfer_m2(jnp.broadcast_to(x, (*leading, *x.shape[-2:])), jnp.broadcast_to(y, (*leading, *y.shape[-2:])))


@jax.custom_vjp
def _chamfer_m2(x: Float[Array, "*batch N 3"], y: Float[Array, "*batch M 3"]) -> Float[Array, "*batch"]:
    # Rows of pairs are made and reduced at once, for either direction; a column would have to go through memory.
    return _squared_distances(x, y).min(-1).mean(-1) + _squared_distances(y, x).min(-1).mean(-1)


def _forward(
    x: Float[Array, "*batch N 3"], y: Float[Array, "*batch M 3"]
) -> tuple[Float[Array, "*batch"], tuple[Array, Array, Nearest]]:
    return _chamfer_m2(x, y), (x, y, (_nearest(x, y), _nearest(y, x)))


def _backward(kept: tuple[Array, Array, Nearest], bar: Float[Array, "*batch"]) -> tuple[Array, Array]:
    x, y, (to_y, to_x) = kept

    def between(x: Float[Array, "*batch N 3"], y: Float[Array, "*batch M 3"]) -> Float[Array, "*batch"]:
        forth = x - jnp.take_along_axis(y, to_y[..., None], -2)
        back = y - jnp.take_along_axis(x, to_x[..., None], -2)
        return (forth**2).sum(-1).mean(-1) + (back**2).sum(-1).mean(-1)

    return jax.vjp(between, x, y)[1](bar)


_chamfer_m2.defvjp(_forward, _backward)


def _nearest(x: Float[Array, "*batch N 3"], y: Float[Array, "*batch M 3"]) -> Int[Array, "*batch N"]:
    """Index of the point of `y` nearest to each of `x`, the first of those that rounding does not tell apart.

    Two minima, of distances and of indices, are vectorised, where one of pairs (`argmin`) takes seven times as long.
    """
    squared = _squared_distances(x, y)
    least = jax.lax.optimization_barrier(squared.min(-1, keepdims=True))
    within = squared <= least * (1 + _ROUNDED * jnp.finfo(squared.dtype).eps)
    return jnp.where(within, jnp.arange(y.shape[-2], dtype=squared.dtype), jnp.inf).min(-1).astype(int)


def _squared_distances(x: Float[Array, "*batch N 3"], y: Float[Array, "*batch M 3"]) -> Float[Array, "*batch N M"]:
    """Squared distances of all pairs [m^2], axis by axis: a sum over an axis of three is not vectorised."""
    # Without the barrier, what makes a point is made again for every pair that it is in.
    x, y = jax.lax.optimization_barrier((x, y))
    along = (x[..., :, None, axis] - y[..., None, :, axis] for axis in range(3))
    first, second, third = (each**2 for each in along)
    return first + second + third
