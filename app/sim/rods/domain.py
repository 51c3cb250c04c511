"""Domain of rods: where rope and finger may be, and how the finger may move, for the model to say anything.

Each measure is one program, outside of simulators too: an autopsy has as many states as steps were made.
"""

from functools import partial

import jax
import jax.numpy as jnp
from jaxtyping import Array, Bool, Float

from app.sim.rods.scene import RodScene

ROOM_M = 10.0
"""Farthest place along each axis [m]: there single precision resolves 1e-6 m, a hundredth of how far a rope gives way
before it slides, and a finger's speed from its path to 1 mm/s."""


_PLACES = 17

STRAIN = 0.5
"""Share by which a segment may be longer or shorter than at rest: pushed at 0.15 m/s it is so by 0.01, at 2 m/s by
0.05, and by more than 0.1 where a rope is thrown at a wall."""


def is_in_domain(
    scene: RodScene,
    start: Float[Array, "B 8 n"],
    tool: Float[Array, "B T 3"],
) -> Bool[Array, " B"]:
    """Candidates whose rope begins unbroken within the room, and whose finger stays there and meets the rope.

    In a step among the rope the finger goes no farther than the rope's radius: it would be on the other side before
    contact acts. A rope that it begins in springs aside, which is simulated; `checks` and autopsies tell it.
    """
    meets = strides_m(scene.radius_m, tool).max(1, initial=0.0) <= scene.radius_m
    return are_whole(scene, start) & (jnp.abs(tool).max((1, 2)) <= ROOM_M) & meets


def are_whole(scene: RodScene, nodes: Float[Array, "B 8 n"]) -> Bool[Array, " B"]:
    """Ropes that are within the room, and no segment of which is strained by more than half."""
    near = jnp.abs(nodes[:, :2]).max((1, 2)) <= ROOM_M
    return near & (jnp.abs(strains(scene.rest_m, nodes)).max(1) <= STRAIN)


@partial(jax.jit, static_argnums=0)
def strains(rest_m: float, nodes: Float[Array, "B 8 n"]) -> Float[Array, "B n-1"]:
    """Strain of each segment: relative elongation."""
    return jnp.linalg.norm(jnp.diff(nodes[:, :2], axis=2), axis=1) / rest_m - 1


@partial(jax.jit, static_argnums=0)
def strides_m(radius_m: float, tool: Float[Array, "B T 3"]) -> Float[Array, "B T-1"]:
    """Lengths of a finger's horizontal steps [m] that end in the height of a rope; 0 for the others."""
    return jnp.where(_is_down(radius_m, tool[:, 1:]), jnp.linalg.norm(jnp.diff(tool[..., :2], axis=1), axis=-1), 0.0)


@partial(jax.jit, static_argnums=0)
def gap_m(
    radius_m: float, nodes: Float[Array, "B 8 n"], tip: Float[Array, "B 3"], half: Float[Array, "B 2"]
) -> Float[Array, " B"]:
    """Distance [m] from the finger's core to the centreline; infinite where the tip is above the rope."""
    gap = distances_m(nodes[:, :2], tip[:, :2], half).min(1)
    return jnp.where(_is_down(radius_m, tip), gap, jnp.inf)


@jax.jit
def distances_m(
    line: Float[Array, "B 2 n"], middle: Float[Array, "B 2"], half: Float[Array, "B 2"]
) -> Float[Array, "B n-1"]:
    """Distances [m] from a finger's core to the segments of a polygon.

    `half`: from the core's middle to an end, zero of a round finger. Of a flat one places on it are looked at, a
    sixteenth of its width apart, 3 mm at most.
    """
    edge = jnp.diff(line, axis=2)[:, None]
    places = middle[:, None] + jnp.linspace(-1, 1, _PLACES)[:, None] * half[:, None]
    to = places[..., None] - line[:, None, :, :-1]
    share = jnp.clip((to * edge).sum(2) / (edge**2).sum(2), 0.0, 1.0)
    return jnp.linalg.norm(to - share[:, :, None] * edge, axis=2).min(1)


def _is_down(radius_m: float, tip: Float[Array, "*b 3"]) -> Bool[Array, "*b"]:
    """Fingers whose tip is below the top of a lying rope."""
    return tip[..., 2] < 2 * radius_m
