"""Problems of filling a bowl to a mark: a part of the liquid is poured, and the rest kept."""

from dataclasses import dataclass
from typing import final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.shapes.fixtures import Bowl
from app.core.geometry.shapes.tools import HeldBowl
from app.core.types import Points
from app.tasks.elements.base import Nodes, ProblemSampler
from app.tasks.elements.pouring import pool

_BORDER_M = 0.004
"""Scale [m] of the border of a bowl at which a particle counts as half inside, so that amounts have slopes."""
_SMOOTH = 1e-3
"""Difference of shares below which its absolute value is rounded off: a third of one particle of 300."""


@final
@dataclass(frozen=True, kw_only=True)
class MarkedBowl:
    """A bowl that shall be filled to a mark: the part of space in it, below its rim.

    The ball `radius_m` about `place_m` [m], below its middle. Its wall may be counted in, so that noise does not take
    liquid out of it.
    """

    place_m: tuple[float, float, float]
    radius_m: float

    def share(self, x: Points) -> float:
        """Share of the particles `x` (N, 3) [m] in it."""
        away = x - np.asarray(self.place_m, np.float32)
        return float(np.mean((np.linalg.norm(away, axis=1) < self.radius_m) & (away[:, 2] < 0)))

    def soft_share(self, x: Float[Array, "*batch N 3"]) -> Float[Array, "*batch"]:
        """The same with soft borders, which has slopes."""
        away = x - jnp.asarray(self.place_m, jnp.float32)
        deep = self.radius_m - jnp.sqrt((away**2).sum(-1) + _BORDER_M**2)
        return (jax.nn.sigmoid(deep / _BORDER_M) * jax.nn.sigmoid(-away[..., 2] / _BORDER_M)).mean(-1)


@final
@dataclass(frozen=True, kw_only=True)
class Filled:
    """The marked bowl holds what it does in the goal, within the share `within` of all the liquid."""

    bowl: MarkedBowl
    within: float

    def is_reached(self, x: Points, goal: Points) -> bool:
        """Neither too little nor too much."""
        return abs(self.bowl.share(x) - self.bowl.share(goal)) <= self.within

    def share(self, x: Points, goal: Points) -> float:
        """Share of the wanted amount that is there; what is too much counts like what is missing."""
        wanted = self.bowl.share(goal)
        return max(0.0, 1.0 - abs(self.bowl.share(x) - wanted) / wanted)


@final
@dataclass(frozen=True, kw_only=True)
class ToMark:
    """The Chamfer distance, and the way of what is in the wrong bowl: its share times `apart_m` squared.

    That of clouds alone hardly tells amounts: a bowl that is a tenth too full has a level that is a few millimetres
    too high. The second part is the squared Wasserstein distance of two heaps `apart_m` [m] from each other.
    """

    bowl: MarkedBowl
    apart_m: float

    def __call__(self, x: Float[Array, "B N 3"], goal: Float[Array, "M 3"]) -> Float[Array, " B"]:
        """Distance [m^2] of each candidate."""
        wrong = self.bowl.soft_share(x) - self.bowl.soft_share(goal)
        return chamfer_m2(x, goal[None]) + self.apart_m**2 * jnp.sqrt(wrong**2 + _SMOOTH**2)


@final
@dataclass(frozen=True, kw_only=True)
class FillingProblems:
    """The problems `whole`, but only a share of the object, evenly between `marks` by seed, shall be in the other bowl.

    What is left stays in the held bowl, which in the goal is upright about `rest_m` [m]. The object is a liquid of
    `volume_m3`, or one with pieces, which in the goal are anywhere in it.
    """

    whole: ProblemSampler
    volume_m3: float
    held: HeldBowl
    target: Bowl
    marks: tuple[float, float]
    rest_m: tuple[float, float, float]

    def start(self, seed: int) -> Nodes:
        """All of the liquid in the held bowl."""
        return self.whole.start(seed)

    def goal(self, seed: int, particle_count: int) -> Points:
        """The liquid at rest in both bowls."""
        poured = round(float(np.random.default_rng([seed, 3]).uniform(*self.marks)) * particle_count)
        kept = particle_count - poured
        parts = [
            pool(np.asarray(middle), bowl.radius_m, volume_m3=count / particle_count * self.volume_m3, count=count)
            for bowl, middle, count in ((self.target, self.target.place_m, poured), (self.held, self.rest_m, kept))
        ]
        return np.concatenate(parts)

    def particles(self, nodes: Nodes, particle_count: int) -> Points:
        """Particles that share the world's volume."""
        return self.whole.particles(nodes, particle_count)
