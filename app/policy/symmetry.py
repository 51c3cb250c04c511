"""Symmetries of a table: rotations, reflections and shifts under which policies generalise demonstrations."""

from dataclasses import dataclass
from math import pi
from typing import Final, Literal, NamedTuple, Self, final

import jax.numpy as jnp
import numpy as np
from jax.lax import Precision
from jaxtyping import Array, Float

_ABOUT_RAD: Final = 0.5
_ABOUT_M: Final = 0.03
"""Ranges about their frame in which augmented examples are drawn, if a task may be turned or shifted: real objects
are seldom exactly in their frame."""


@final
class Isometry(NamedTuple):
    """B isometries of the table: reflection across the x axis or not (-1 or 1), rotation [rad], and then shift [m].

    Heights stay. Also a JAX pytree.
    """

    side: Float[Array, " B"]
    angle: Float[Array, " B"]
    shift: Float[Array, "B 2"]

    @classmethod
    def identity(cls, count: int) -> Self:
        """The identity."""
        return cls(jnp.ones(count), jnp.zeros(count), jnp.zeros((count, 2)))

    @property
    def matrix(self) -> Float[Array, "B 2 2"]:
        """Matrix of the isometry's linear part on the table."""
        c, s = jnp.cos(self.angle), jnp.sin(self.angle)
        return jnp.stack([jnp.stack([c, -self.side * s], -1), jnp.stack([s, self.side * c], -1)], -2)

    @property
    def inverse(self) -> Self:
        """The inverse isometry."""
        back = type(self)(self.side, -self.side * self.angle, jnp.zeros_like(self.shift))
        return back._replace(shift=-back.directions(self.shift))

    def after(self, first: Self) -> Self:
        """Composition: `first`, then this."""
        return type(self)(self.side * first.side, self.angle + self.side * first.angle, self.places(first.shift))

    def directions(self, v: Float[Array, "B *axes K"]) -> Float[Array, "B *axes K"]:
        """Transformed vectors of 2 or 3 numbers, the first two in the table's plane."""
        level = jnp.einsum("bij,b...j->b...i", self.matrix, v[..., :2], precision=Precision.HIGHEST)
        return jnp.concatenate([level, v[..., 2:]], axis=-1)

    def places(self, x: Float[Array, "B *axes K"]) -> Float[Array, "B *axes K"]:
        """Transformed points [m] of 2 or 3 numbers."""
        shift = self.shift.reshape(len(self.shift), *[1] * (x.ndim - 2), 2)
        return self.directions(x) + jnp.concatenate([shift, jnp.zeros((*shift.shape[:-1], x.shape[-1] - 2))], axis=-1)

    def rotations(self, w: Float[Array, "B *axes 3"]) -> Float[Array, "B *axes 3"]:
        """Transformed rotation vectors; a reflection reverses their sense."""
        return self.directions(w) * self.side.reshape(len(self.side), *[1] * (w.ndim - 1))

    def poses(self, tool: Float[Array, "B 8"]) -> Float[Array, "B 8"]:
        """Transformed poses of a tool that is its own mirror image across the plane of its x and z axes.

        A pose is position, quaternion and opening.
        """
        w, x, y, z = jnp.moveaxis(tool[:, 3:7], -1, 0)
        x, z = self.side * x, self.side * z
        c, s = jnp.cos(self.angle / 2), jnp.sin(self.angle / 2)
        turn = jnp.stack([c * w - s * z, c * x - s * y, c * y + s * x, c * z + s * w], axis=-1)
        return jnp.concatenate([self.places(tool[:, :3]), turn, tool[:, 7:]], axis=1)


@final
@dataclass(frozen=True, kw_only=True)
class Symmetry:
    """Isometries of the table under which a task is invariant.

    It may be turned by any of `angles_rad` about `about_m` (x, y), or by any angle where it `turns`; be `mirrored`
    across a line along x through there; and be shifted by up to `shift_m` (x, y) either way.

    What may be turned by any angle is looked at in a frame: with its goal, or its object, `along` the x axis, and that
    in the middle where it may be shifted as well. A policy that acts in that frame does alike what is turned, and need
    not learn that it is alike.
    """

    about_m: tuple[float, float] = (0.0, 0.0)
    angles_rad: tuple[float, ...] = (0.0,)
    turns: bool = False
    mirrored: bool = False
    shift_m: tuple[float, float] = (0.0, 0.0)
    along: Literal["goal", "object"] = "goal"

    @property
    def everywhere(self) -> bool:
        """True if a goal may be anywhere that an object may come to lie, so that every action leads to some goal."""
        return self.turns and self.along == "goal"

    def frame(self, goal: Float[Array, "B M 3"], x: Float[Array, "B N 3"]) -> Isometry:
        """Isometry that brings each of these goals and objects [m] into its frame; the identity if a task has none."""
        count = len(x)
        if not self.turns:
            return Isometry.identity(count)
        level = (goal if self.along == "goal" else x)[..., :2]
        about = jnp.array(self.about_m)
        middle = level.mean(1) if any(self.shift_m) else jnp.tile(about, (count, 1))
        off = level - middle[:, None]
        xx, yy, xy = (off[..., 0] ** 2).mean(1), (off[..., 1] ** 2).mean(1), off.prod(-1).mean(1)
        # The principal axis of the second moments; either way round, as what is drawn is.
        turned = Isometry(jnp.ones(count), -0.5 * jnp.arctan2(2 * xy, xx - yy), jnp.zeros((count, 2)))
        return turned._replace(shift=about - turned.directions(middle))

    def draw(self, rng: np.random.Generator, count: int) -> Isometry:
        """Random isometries, uniform; for a task with a frame, those near it."""
        if self.turns:
            angle = rng.choice([0.0, pi], count) + rng.uniform(-_ABOUT_RAD, _ABOUT_RAD, count)
            far = np.minimum(self.shift_m, _ABOUT_M)
        else:
            angle, far = rng.choice(self.angles_rad, count), np.array(self.shift_m)
        side = np.where(self.mirrored & (rng.random(count) < 0.5), -1.0, 1.0)
        about, (c, s) = np.array(self.about_m), (np.cos(angle), np.sin(angle))
        went = np.stack([c * about[0] - side * s * about[1], s * about[0] + side * c * about[1]], axis=1)
        shift = about - went + rng.uniform(-1, 1, (count, 2)) * far
        return Isometry(*(jnp.asarray(each, jnp.float32) for each in (side, angle, shift)))
