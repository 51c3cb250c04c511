"""What is hidden in a case, drawn from its number and a seed by the shares that docs/discovery.md states."""

from dataclasses import dataclass
from functools import cache
from typing import Literal, TypeAlias, final

import numpy as np

from app.discovery.subject import NUMERICS, catalogue
from app.rig.simulated.hiding import known
from bench.hidden.outside import OUTSIDE

World: TypeAlias = Literal["own", "mujoco"]
"""The engine that makes the recordings: ours with other numerics, or another one."""
WORLDS: tuple[World, ...] = ("own", "mujoco")

NONE, TWO, UNKNOWN = 0.25, 0.15, 0.15
"""Shares of cases with nothing hidden, with two effects, and with one that is in no catalogue; the rest have one."""
SIZES = 0.25, 2.0
"""In units of the typical size, log-uniform."""
_GRAINS_AND_LIQUIDS = frozenset({"cohesion", "shear_thinning"})


@final
@dataclass(frozen=True, kw_only=True)
class Chosen:
    """An effect to hide; `size` in units of its typical size."""

    effect: str
    size: float


@final
@dataclass(frozen=True, kw_only=True)
class Case:
    """A recording session to be made: its number, the world that makes it, and what is hidden."""

    number: int
    world: World
    hidden: tuple[Chosen, ...]

    @property
    def key(self) -> str:
        """Its name in a file of results."""
        return f"{self.world}-{self.number}"


def drawn(seed: int, number: int, world: World) -> Case:
    """The case of that number; the same whatever other cases are drawn."""
    rng = np.random.default_rng([seed, number, WORLDS.index(world)])
    inside, outside = kinds(world), outsiders(world)
    share = rng.uniform()
    if share < NONE:
        names = list[str]()
    elif share < NONE + TWO:
        names = sorted(rng.choice(inside, 2, replace=False).tolist())
    elif share < NONE + TWO + UNKNOWN:
        names = [str(rng.choice(outside))]
    else:
        names = [str(rng.choice(inside))]
    sizes = np.exp(rng.uniform(np.log(SIZES[0]), np.log(SIZES[1]), len(names))).tolist()
    hidden = tuple(Chosen(effect=name, size=size) for name, size in zip(names, sizes, strict=True))
    return Case(number=number, world=world, hidden=hidden)


@cache
def kinds(world: World) -> tuple[str, ...]:
    """The causes of the catalogue that this world can hide."""
    if world == "mujoco":
        return tuple(sorted(name for name, effect in known().items() if effect.catalogued))
    names = {cause.name for cause in catalogue().causes}
    return tuple(sorted(names - _GRAINS_AND_LIQUIDS - NUMERICS.keys()))


@cache
def outsiders(world: World) -> tuple[str, ...]:
    """What this world can hide that the catalogue lacks."""
    if world == "mujoco":
        return tuple(sorted(name for name, effect in known().items() if not effect.catalogued))
    return tuple(sorted(OUTSIDE))
