"""Problems of filling a bowl to a mark: a part of the liquid is poured, and the rest kept."""

from dataclasses import dataclass
from typing import final

import numpy as np

from app.core.geometry.shapes.fixtures import Bowl
from app.core.geometry.shapes.tools import HeldBowl
from app.core.types import Points
from app.policy.marked_bowl import MarkedBowl
from app.tasks.elements.base import Nodes, ProblemSampler
from app.tasks.elements.pouring import pool


@final
@dataclass(frozen=True, kw_only=True)
class Filled:
    """The marked bowl holds what it does in the goal, within the share `within` of all the liquid that there is.

    What is not in it may be anywhere: the cost alone keeps it in the other bowl.
    """

    bowl: MarkedBowl
    within: float

    def is_reached(self, x: Points, goal: Points) -> bool:
        """Neither too little nor too much."""
        return abs(self.bowl.share(x) - self.bowl.share(goal)) <= self.within

    def share(self, x: Points, goal: Points) -> float:
        """Share of the wanted amount that is there; what is too much counts like what is missing."""
        wanted, there = self.bowl.share(goal), self.bowl.share(x)
        return max(0.0, 1.0 - abs(there - wanted) / wanted) if wanted else float(there == 0.0)


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
        """The liquid at rest in both bowls, as much in the target as its mark says."""
        return self.pools(float(np.random.default_rng([seed, 3]).uniform(*self.marks)), particle_count)

    def pools(self, share: float, particle_count: int) -> Points:
        """The liquid at rest in both bowls, this share of it in the target."""
        poured = round(share * particle_count)
        kept = particle_count - poured
        parts = [
            pool(np.asarray(middle), bowl.radius_m, volume_m3=count / particle_count * self.volume_m3, count=count)
            for bowl, middle, count in ((self.target, self.target.place_m, poured), (self.held, self.rest_m, kept))
        ]
        return np.concatenate(parts)

    def particles(self, nodes: Nodes, particle_count: int) -> Points:
        """Particles that share the world's volume."""
        return self.whole.particles(nodes, particle_count)
