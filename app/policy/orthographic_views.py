"""Pictures of observed and predicted particles, for policies that look, as JAX functions."""

from dataclasses import dataclass
from typing import Final, final

import jax.numpy as jnp
from jaxtyping import Array, Float, Int

CHANNELS: Final = 2
"""Density of the object over a pixel, and its height there."""
_BLOCK: Final = 16
"""Sides of pictures are multiples of this, so that networks may halve them four times."""


@final
@dataclass(frozen=True, kw_only=True)
class OrthographicView:
    """A picture as an orthographic camera takes it: pixels of `pixel_m` between corners `low` and `high` [m].

    Rows go along the first of `axes`, columns along the second, and what rises does so along the third, all upwards;
    (0, 1, 2) looks down on a table. What lies outside of the corners is not in the picture.
    """

    low: tuple[float, float, float]
    high: tuple[float, float, float]
    pixel_m: float
    axes: tuple[int, int, int] = (0, 1, 2)

    @property
    def shape(self) -> tuple[int, int]:
        """Rows and columns: enough for the corners, and as many as networks like."""
        sides = [(self.high[axis] - self.low[axis]) / self.pixel_m for axis in self.axes[:2]]
        rows, columns = (-int(-side // _BLOCK) * _BLOCK for side in sides)
        return rows, columns

    @property
    def depth_m(self) -> float:
        """Range of depth from the lowest to the highest point in view."""
        return self.high[self.axes[2]] - self.low[self.axes[2]]

    def pixels(self, points: Float[Array, "*axes 3"]) -> Float[Array, "*axes 2"]:
        """Pixel coordinates (row, column) of points [m]; the middle of the first pixel is (0, 0)."""
        rows, columns, _ = self.axes
        origin = jnp.array([self.low[rows], self.low[columns]])
        return (points[..., [rows, columns]] - origin) / self.pixel_m - 0.5

    def picture(self, x: Float[Array, "B N 3"]) -> Float[Array, "B R C 2"]:
        """Picture of each candidate's particles [m]: `CHANNELS` values from 0 on, differentiable in `x`.

        The first is the share of all particles over a pixel, 1 if it is that of particles spread evenly over a tenth of
        the picture; particles count for the four pixels about them. The second is the height of the highest of those
        that are nearest to the pixel, as a share of the view's depth.
        """
        rows, columns = self.shape
        at = self.pixels(x)
        low = jnp.floor(at).astype(jnp.int32)
        part = at - low
        candidates = jnp.arange(len(x))[:, None]
        density = jnp.zeros((len(x), rows, columns))
        for row, column in ((0, 0), (0, 1), (1, 0), (1, 1)):
            share = jnp.abs(1 - row - part[..., 0]) * jnp.abs(1 - column - part[..., 1])
            there = self._inside(low + jnp.array([row, column]))
            density = density.at[candidates, there[..., 0], there[..., 1]].add(share, mode="drop")
        nearest = self._inside(jnp.round(at).astype(jnp.int32))
        rise = (x[..., self.axes[2]] - self.low[self.axes[2]]) / self.depth_m
        height = jnp.zeros((len(x), rows, columns))
        height = height.at[candidates, nearest[..., 0], nearest[..., 1]].max(rise, mode="drop")
        return jnp.stack([density * (0.1 * rows * columns / x.shape[1]), height], axis=-1)

    def _inside(self, pixels: Int[Array, "B N 2"]) -> Int[Array, "B N 2"]:
        """The same pixels; those outside of the picture as one that is nowhere, which negative ones would not be."""
        outside = (pixels < 0) | (pixels >= jnp.array(self.shape))
        return jnp.where(outside.any(-1, keepdims=True), jnp.array(self.shape), pixels)
