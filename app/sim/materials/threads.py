"""Initial state of a cloth's law: the directions of its threads at each particle, from positions alone.

Cameras give particles without order or history. An observed cloth is taken to be at rest: its threads are as long as
they were woven. Their direction in its plane cannot be observed, and matters little to a law whose shear stiffness is
near that of an isotropic sheet; they are laid along the world's x axis.
"""

from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Float

from app.sim.state import State

NEIGHBOURS = 12
"""A particle and its two rings on a hexagonal lattice are 19, its nearest one 7: enough that noise averages out, and
few enough to follow a bend about a rod."""
_STEEP = 0.9
"""Cosine between normal and x axis above which the threads are laid along y instead."""


def cloth_at_rest(x: Float[Array, "B N 3"], near: Float[Array, "2 n"] | None = None) -> State:
    """A cloth at rest whose particles are at `x` [m]: the columns of F are its two threads and its normal.

    It has no centreline that could be `near`.
    """
    del near
    state = State.at_rest(x)
    return state._replace(F=threads(state.x))


def threads(x: Float[Array, "B N 3"]) -> Float[Array, "B N 3 3"]:
    """A rotation at each particle of `x` [m]: two directions in the plane of its nearest neighbours, and their normal.

    The plane is that of the least squared distances. Where there are too few particles for a plane, or they coincide,
    it is an arbitrary one. Nothing is differentiated with respect to it.
    """
    normal = _normals(jax.lax.stop_gradient(x))
    ahead = jnp.where(jnp.abs(normal[..., :1]) < _STEEP, jnp.array([1.0, 0.0, 0.0]), jnp.array([0.0, 1.0, 0.0]))
    warp = ahead - (ahead * normal).sum(-1, keepdims=True) * normal
    warp = warp / jnp.linalg.norm(warp, axis=-1, keepdims=True)
    return jnp.stack([warp, jnp.cross(normal, warp), normal], axis=-1)


@partial(jax.jit, inline=True)
def _normals(x: Float[Array, "B N 3"]) -> Float[Array, "B N 3"]:
    """Unit vectors across the plane of each particle's neighbours, upwards."""
    count = min(NEIGHBOURS, x.shape[1])
    squared = ((x[:, :, None] - x[:, None]) ** 2).sum(-1)
    _, near = jax.lax.top_k(-squared, count)
    around = jnp.take_along_axis(x[:, :, None], near.reshape(len(x), -1, 1, 1), axis=1).reshape(*near.shape, 3)
    around = around - around.mean(axis=2, keepdims=True)
    spread = jnp.einsum("bnki,bnkj->bnij", around, around, precision=jax.lax.Precision.HIGHEST)
    # Unit lengths: of square metres, float32 keeps too few digits for an eigenvector.
    size = jnp.trace(spread, axis1=-2, axis2=-1)[..., None, None]
    _, axes = jnp.linalg.eigh(spread / jnp.maximum(size, 1e-12) + 1e-6 * jnp.eye(3))
    normal = axes[..., 0]
    return jnp.where(normal[..., 2:] < 0.0, -normal, normal)
