"""Local directions of a slender object at its particles, from their positions alone."""

from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Float

from app.sim.model.scene import Scene
from app.sim.state import Setting

_WIDTH_CELLS = 0.8
"""Width, in cells, of the neighbourhood of a particle: features narrower than a cell are not simulated."""
_TOGETHER = 8
"""Candidates at once: the distances of all pairs take memory."""


def find_directions(scene: Scene, setting: Setting, x: Float[jax.Array, "B N 3"]) -> Setting:
    """The setting with offset and direction of particles whose direction is unknown (0), where a material needs it."""
    if not any(body.material.law.directed for body in scene.bodies):
        return setting
    width_m = _WIDTH_CELLS * scene.cell_m

    def label(cloud: jax.Array) -> jax.Array:
        return _label(cloud, width_m)

    seen = jax.lax.map(label, x, batch_size=_TOGETHER)
    unknown = (setting.label[..., 2:] == 0).all(-1, keepdims=True)
    known = jnp.where(unknown, seen.at[..., 0].set(setting.label[..., 0]), setting.label)
    return setting._replace(label=jax.lax.stop_gradient(known))


@partial(jax.jit, inline=True)
def _label(x: Float[jax.Array, "N 3"], width_m: float | jax.Array) -> Float[jax.Array, "N 4"]:
    """Offset and principal direction in the plane of each particle's neighbourhood; its sign is arbitrary."""
    place = jax.lax.stop_gradient(x[:, :2] - x[:, :2].mean(0)) / width_m
    apart = jnp.square(place[:, None] - place[None]).sum(-1)
    weight = jnp.exp(-0.5 * apart)
    weight /= weight.sum(1, keepdims=True)
    middle = _mean(weight, place)
    xx, yy, xy = _mean(weight, jnp.stack([place[:, 0] ** 2, place[:, 1] ** 2, place[:, 0] * place[:, 1]], 1)).T
    xx, yy, xy = xx - middle[:, 0] ** 2, yy - middle[:, 1] ** 2, xy - middle[:, 0] * middle[:, 1]
    angle = 0.5 * jnp.arctan2(2 * xy, xx - yy)
    along = jnp.stack([jnp.cos(angle), jnp.sin(angle)], 1)
    left = (place - middle)[:, 1] * along[:, 0] - (place - middle)[:, 0] * along[:, 1]
    return jnp.concatenate([jnp.zeros_like(left)[:, None], left[:, None] * width_m, along], 1)


def _mean(weight: Float[jax.Array, "N N"], values: Float[jax.Array, "N D"]) -> Float[jax.Array, "N D"]:
    """Weighted means, in full precision on every device."""
    return jnp.matmul(weight, values, precision=jax.lax.Precision.HIGHEST)
