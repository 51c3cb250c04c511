"""Problems of beans spilt on a table around the mat that is their goal."""

from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float64
from scipy.stats import qmc

from app.core.geometry.scene_description import Beans
from app.core.geometry.shapes.fixtures import Mat
from app.core.types import Points
from app.tasks.elements.base import Nodes

_TRIES = 10_000
Place: TypeAlias = Float64[np.ndarray, "2"]
Ends: TypeAlias = Float64[np.ndarray, "C 2 2"]
"""The middles of the round ends of beans, seen from above [m]."""


@final
@dataclass(frozen=True, kw_only=True)
class BeanProblems:
    """Initial places of beans: a few spills, each a normal distribution, off the mat and not on top of each other.

    A spill's middle is `distance_m` from the mat's and inside `region` (x low, y low, x high, y high) [m], as every
    bean is; `spread_m` is its standard deviation along x and along y, and `spills` how many there may be. `margin_m`
    is kept between the mat's rim and the beans. The goal is the same for all: the disc of `goal_m` about the mat's
    middle, filled evenly. It is smaller than the mat, so that a bean at its rim still lies on the mat.
    """

    beans: Beans
    mat: Mat
    region: tuple[float, float, float, float]
    goal_m: float
    distance_m: tuple[float, float] = (0.17, 0.27)
    spread_m: tuple[float, float] = (0.04, 0.08)
    spills: tuple[int, int] = (3, 5)
    margin_m: float = 0.02

    def start(self, seed: int) -> Nodes:
        """The beans' nodes [m] at first, two a bean (see `stage.Beans`). Raises ValueError where they do not fit."""
        rng = np.random.default_rng(seed)
        spills = [self._spill(rng) for _ in range(rng.integers(self.spills[0], self.spills[1] + 1))]
        reach_m = self.beans.length_m / 2 - self.beans.radius_m
        laid = np.zeros((0, 2, 2))
        for _ in range(_TRIES):
            if len(laid) == self.beans.count:
                break
            middle, spread_m = spills[rng.integers(len(spills))]
            angle = rng.uniform(0, np.pi)
            along = reach_m * np.array([np.cos(angle), np.sin(angle)])
            bean = rng.normal(middle, spread_m) + np.array([-along, along])
            if self._free(bean, laid):
                laid = np.concatenate([laid, bean[None]])
        else:
            raise ValueError(f"No room for {self.beans.count} beans in {_TRIES} tries; widen {self}.")
        return np.concatenate([laid, np.full((len(laid), 2, 1), self.beans.radius_m)], axis=2).reshape(-1, 3)

    def goal(self, seed: int, particle_count: int) -> Points:
        """Points that fill the goal evenly, as high as a bean."""
        del seed
        share, angle, up = qmc.Halton(3, rng=0).random(particle_count).T
        radius = self.goal_m * np.sqrt(share)
        around = np.stack([np.cos(2 * np.pi * angle), np.sin(2 * np.pi * angle)], axis=1)
        level = self.mat.place_m + radius[:, None] * around
        return np.concatenate([level, 2 * self.beans.radius_m * up[:, None]], axis=1).astype(np.float32)

    def particles(self, nodes: Nodes, particle_count: int) -> Points:
        """Each bean has its share of the particles, spread evenly through a cylinder as large as it is.

        Raises ValueError where there are more beans than particles.
        """
        beans = nodes.reshape(-1, 2, 3)
        if particle_count < len(beans):
            raise ValueError(f"{len(beans)} beans cannot be {particle_count} particles.")
        owner = np.arange(particle_count) * len(beans) // particle_count
        along = beans[:, 1] - beans[:, 0]
        along /= np.linalg.norm(along, axis=1, keepdims=True)
        side = np.cross(along, [0.0, 0.0, 1.0])
        side /= np.linalg.norm(side, axis=1, keepdims=True)
        lengthwise, across, angle = qmc.Halton(3, rng=0).random(particle_count).T
        # A bean's volume is that of a cylinder of its radius which is a third of a diameter shorter than the bean.
        length_m = self.beans.length_m - 2 / 3 * self.beans.radius_m
        radius = self.beans.radius_m * np.sqrt(across)
        points = beans.mean(1)[owner] + ((lengthwise - 0.5) * length_m)[:, None] * along[owner]
        points += (radius * np.cos(2 * np.pi * angle))[:, None] * side[owner]
        points += (radius * np.sin(2 * np.pi * angle))[:, None] * np.cross(side, along)[owner]
        return points.astype(np.float32)

    def _spill(self, rng: np.random.Generator) -> tuple[Place, float]:
        """Middle and spread of a spill."""
        for _ in range(_TRIES):
            angle, distance_m = rng.uniform(0, 2 * np.pi), rng.uniform(*self.distance_m)
            middle = self.mat.place_m + distance_m * np.array([np.cos(angle), np.sin(angle)])
            if self._inside(middle):
                return middle, float(rng.uniform(*self.spread_m))
        raise ValueError(f"No place for a spill in {_TRIES} tries; widen {self}.")

    def _inside(self, points: Float64[np.ndarray, "*points 2"]) -> bool:
        return bool(np.all(points >= self.region[:2]) and np.all(points <= self.region[2:]))

    def _free(self, bean: Float64[np.ndarray, "2 2"], laid: Ends) -> bool:
        """True if it lies inside the region, off the mat, and touches no other: compared by circles in a bean."""
        from_mat = np.linalg.norm(bean - self.mat.place_m, axis=1).min() - self.mat.radius_m
        apart = np.linalg.norm(_circles(bean[None])[:, None] - _circles(laid), axis=-1).min(initial=np.inf)
        off_mat, alone = from_mat > self.margin_m + self.beans.radius_m, apart > 2 * self.beans.radius_m
        return self._inside(bean) and bool(off_mat and alone)


def _circles(beans: Ends) -> Float64[np.ndarray, "_ 2"]:
    """Middles of circles that fill each bean's outline: its ends and its middle."""
    return np.concatenate([beans, beans.mean(1, keepdims=True)], axis=1).reshape(-1, 2)
