"""A rope as it is known, and a cloud of its points in the plane."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

_MOST_BEYOND = 0.7
"""Length of a cloud beyond either end of its centreline, in radii: round ends hold 2/3, and depth is blurred."""


@final
@dataclass(frozen=True, kw_only=True)
class RopeShape:
    """Rope as it is known: number of nodes, their distance `rest_m`, and its radius."""

    count: int
    rest_m: float
    radius_m: float

    @property
    def length_m(self) -> float:
        """Length of the centreline."""
        return self.rest_m * (self.count - 1)

    @property
    def beyond(self) -> float:
        """Extent of its cloud beyond either end of the centreline, in segments."""
        return _MOST_BEYOND * self.radius_m / self.rest_m


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Weighted:
    """Points in the plane [m], relative to their mean `origin`, with weights.

    `share` of the cloud; `variance` of its distance from the centreline [m^2].

    A round rope's points at its top or bottom are near its centreline, those half way up may be a radius beside it: at
    the height z over the table the chord is 2 h wide, h^2 = r^2 - (z - r)^2, and the variance h^2 / 3.
    """

    at: Float64[np.ndarray, "N 2"]
    share: Float64[np.ndarray, " N"]
    variance: Float64[np.ndarray, " N"]
    origin: Float64[np.ndarray, "2"]

    @property
    def weight(self) -> Float64[np.ndarray, " N"]:
        """Weight of each in a fit, one in the mean."""
        weight = self.share / self.variance
        return weight / weight.mean()
