"""Distance of an object from a goal behind a wall with a gap: through the gap, not the wall."""

from dataclasses import dataclass
from typing import final

import jax.numpy as jnp
from jaxtyping import Array, Float

_SMOOTH_M = 1e-4
"""Distances are at least this, so that their roots have slopes."""


@final
@dataclass(frozen=True, kw_only=True)
class Passage:
    """The Chamfer distance along shortest ways on the table past a thin wall along y at `x_m` [m].

    The wall is open between `low_m` and `high_m` along y. A way between points on different sides is straight where
    that leads through the opening, and else bends at its nearer end; without a bend the distance is Chamfer's. The
    straight one has minima in front of the wall, where an object is as near to a goal behind it as it can come.
    """

    x_m: float
    low_m: float
    high_m: float

    def __call__(self, x: Float[Array, "B N 3"], goal: Float[Array, "M 3"]) -> Float[Array, " B"]:
        """Sum of both clouds' mean squared lengths [m^2] of the shortest ways to the nearest point of the other."""
        squared = self._ways_m2(x[:, :, None], goal[None, None])
        return squared.min(2).mean(1) + squared.min(1).mean(1)

    def _ways_m2(self, a: Float[Array, "#B #N #M 3"], b: Float[Array, "#B #N #M 3"]) -> Float[Array, "B N M"]:
        """Squared lengths, height differences included as if the way had no bend."""
        across = b[..., 0] - a[..., 0]
        parted = (a[..., 0] < self.x_m) != (b[..., 0] < self.x_m)
        share = (self.x_m - a[..., 0]) / jnp.where(parted, across, 1.0)
        meets = jnp.clip(a[..., 1] + share * (b[..., 1] - a[..., 1]), self.low_m, self.high_m)
        bent = _length(self.x_m - a[..., 0], meets - a[..., 1]) + _length(b[..., 0] - self.x_m, b[..., 1] - meets)
        level = jnp.where(parted, bent**2, ((b - a)[..., :2] ** 2).sum(-1))
        return level + (b[..., 2] - a[..., 2]) ** 2


def _length(x: Float[Array, "*#axes"], y: Float[Array, "*#axes"]) -> Float[Array, "*axes"]:
    return jnp.sqrt(x**2 + y**2 + _SMOOTH_M**2)
