"""A bowl that is filled to a mark, for policies and costs that count what is in it."""

from dataclasses import dataclass
from typing import final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from app.core.types import Points

_BORDER_M = 0.004
"""Scale [m] of the border of a bowl at which a particle counts as half inside, so that amounts have slopes."""


@final
@dataclass(frozen=True, kw_only=True)
class MarkedBowl:
    """The part of space in a bowl, below its rim: the ball `radius_m` about `place_m` [m], below its middle.

    Its wall may be counted in, so that noise does not take liquid out of it.
    """

    place_m: tuple[float, float, float]
    radius_m: float

    def share(self, x: Points) -> float:
        """Share of the particles `x` (N, 3) [m] in it."""
        away = x - np.asarray(self.place_m)
        return float(np.mean((np.linalg.norm(away, axis=1) < self.radius_m) & (away[:, 2] < 0)))

    def soft_share(self, x: Float[Array, "*batch N 3"]) -> Float[Array, "*batch"]:
        """The same with soft borders, which has slopes."""
        away = x - jnp.asarray(self.place_m, jnp.float32)
        deep = self.radius_m - jnp.sqrt((away**2).sum(-1) + _BORDER_M**2)
        return (jax.nn.sigmoid(deep / _BORDER_M) * jax.nn.sigmoid(-away[..., 2] / _BORDER_M)).mean(-1)
