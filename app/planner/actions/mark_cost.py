"""Distance of a liquid from a goal in which a bowl is filled to a mark: amounts, and not shapes alone."""

from dataclasses import dataclass
from typing import final

import jax.numpy as jnp
from jaxtyping import Array, Float

from app.core.geometry.chamfer import chamfer_m2
from app.policy.marked_bowl import MarkedBowl

_SMOOTH = 1e-3
"""Difference of shares below which its absolute value is rounded off: a third of one particle of 300."""


@final
@dataclass(frozen=True, kw_only=True)
class ToMark:
    """The Chamfer distance, and the way of what is in the wrong bowl: its share times `apart_m` squared.

    That of clouds alone hardly tells amounts: a bowl that is a tenth too full has a level that is a few millimetres
    too high. The second part is the squared Wasserstein distance of two heaps `apart_m` [m] from each other. Plans aim
    at a share that is less by `below`: what is missing can still be poured, what is too much cannot be taken back.
    """

    bowl: MarkedBowl
    apart_m: float
    below: float

    def __call__(self, x: Float[Array, "B N 3"], goal: Float[Array, "M 3"]) -> Float[Array, " B"]:
        """Distance [m^2] of each candidate."""
        wrong = self.bowl.soft_share(x) - self.bowl.soft_share(goal) + self.below
        return chamfer_m2(x, goal[None]) + self.apart_m**2 * jnp.sqrt(wrong**2 + _SMOOTH**2)
