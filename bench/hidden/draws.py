"""Hidden effects of a case, drawn from its number and a seed by the shares that docs/discovery.md states."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Literal, TypeAlias, final

import numpy as np

from app.commands._named import Dynamics
from app.core.geometry.scene_description import Beans, Body, Cloth, Liquid, Rope, Soup
from app.discovery.dataset.model_under_test import Family
from app.jobs.discovery_subject import subject_of
from app.rig.simulated.effect_sampling import InjectionRequest, draw, injectable_effects, not_injectable
from app.rig.simulated.injected_effects.base import LIQUIDS, InjectedEffect
from app.sim.model.numerics import ANY_NUMERICS
from app.tasks import load, name_with_dynamics
from bench.hidden.outside import OUTSIDE

World: TypeAlias = Literal["own", "mujoco"]
"""The engine that makes the recordings: ours with other numerics, or another one."""
WORLDS: tuple[World, ...] = ("own", "mujoco")

BODIES: Mapping[str, type[Body]] = {
    "rope_push": Rope,
    "bean_sweep": Beans,
    "cloth_hang": Cloth,
    "pour_soup": Soup,
    "pour_water": Liquid,
}
"""Class of each task's object."""
NONE, TWO, UNKNOWN = 0.25, 0.15, 0.15
"""Shares of cases with nothing hidden, with two effects, and with one that is in no catalogue; the rest have one."""
SIZES = 0.25, 2.0
"""Range of hidden sizes, in typical ones, log-uniform."""


@final
@dataclass(frozen=True, kw_only=True)
class Making:
    """Conditions of a bench: how ropes are simulated by the solver and by our own world; cameras in MuJoCo's.

    `images`: whether MuJoCo's world is seen in rendered images; without, a noise of centrelines, or of pieces, stands
    for them, and errors of images cannot be hidden; a cloth is always seen in images. `task`: whose object is moved.
    Our own engine has ropes and what is poured, of which MuJoCo has none: its world is the simulated cell's.
    """

    dynamics: Dynamics = "rods"
    images: bool = True
    task: str = "rope_push"

    @property
    def body(self) -> type[Body]:
        """Class of the object."""
        return BODIES[self.task]

    @property
    def worlds(self) -> tuple[World, ...]:
        """The worlds that have such an object."""
        return WORLDS if self.body is Rope else ("own",) if self.body in LIQUIDS else ("mujoco",)

    def is_of_cell(self, world: World) -> bool:
        """True if that world is the simulated cell's, in which `dipac hide` hides."""
        return world == "mujoco" or self.body in LIQUIDS


AS_RODS = Making()


@final
@dataclass(frozen=True, kw_only=True)
class CaseDistribution:
    """Distribution of the cases: range of sizes, in typical ones; `family`: nothing or one effect of it is hidden."""

    sizes: tuple[float, float] = SIZES
    family: Family | None = None


USUAL_CASES = CaseDistribution()


@final
@dataclass(frozen=True, kw_only=True)
class Chosen:
    """An effect to hide; `size` in units of its typical size."""

    effect: str
    size: float


@final
@dataclass(frozen=True, kw_only=True)
class Case:
    """A recording session to be made: its number, its world, and the hidden effects."""

    number: int
    world: World
    hidden: tuple[Chosen, ...]

    @property
    def key(self) -> str:
        """Its name in a file of results."""
        return f"{self.world}-{self.number}"


def drawn(
    seed: int, number: int, world: World, making: Making = AS_RODS, cases: CaseDistribution = USUAL_CASES
) -> Case:
    """The case of that number; the same whatever other cases are drawn."""
    rng = np.random.default_rng([seed, number, WORLDS.index(world)])
    inside, outside = kinds(world, making), outsiders(world, making)
    share = rng.uniform()
    if share < NONE:
        names = list[str]()
    elif cases.family is not None:
        families = _families(making)
        names = [str(rng.choice([name for name in inside if families[name] == cases.family]))]
    elif share < NONE + TWO:
        names = sorted(rng.choice(inside, 2, replace=False).tolist())
    elif share < NONE + TWO + UNKNOWN and outside:
        names = [str(rng.choice(outside))]
    else:
        names = [str(rng.choice(inside))]
    least, most = np.log(cases.sizes).tolist()
    sizes = np.exp(rng.uniform(least, most, len(names))).tolist()
    hidden = tuple(Chosen(effect=name, size=size) for name, size in zip(names, sizes, strict=True))
    return Case(number=number, world=world, hidden=hidden)


@cache
def kinds(world: World, making: Making = AS_RODS) -> tuple[str, ...]:
    """The causes of the solver's catalogue that this world can hide."""
    names = _catalogued(making)
    return tuple(sorted(names & _hideable(making) if making.is_of_cell(world) else names - set(not_injectable())))


@cache
def outsiders(world: World, making: Making = AS_RODS) -> tuple[str, ...]:
    """Effects that this world can hide and that the solver's catalogue lacks."""
    return tuple(sorted(_hideable(making) - _catalogued(making) if making.is_of_cell(world) else OUTSIDE))


def families_of(making: Making, world: World) -> frozenset[Family]:
    """Families of the causes that this world can hide."""
    families = _families(making)
    return frozenset(families[name] for name in kinds(world, making))


def real_size(chosen: Chosen, body: type[Body] = Rope) -> float:
    """Size in the effect's own unit, clipped to its range; of effects in MuJoCo's world, in such an object."""
    main = injectable_effects()[chosen.effect].main_in(body)
    assert main.typical is not None
    return float(np.clip(main.null + chosen.size * (main.typical - main.null), main.low, main.high))


def effects_of(hidden: Sequence[Chosen], seed: int, body: type[Body] = Rope) -> tuple[InjectedEffect, ...]:
    """The chosen effects in such an object of MuJoCo's or the cell's world, their directions and places by `seed`."""
    return draw([InjectionRequest(each.effect, real_size(each, body)) for each in hidden], seed, body)


def _catalogued(making: Making) -> frozenset[str]:
    """Causes of the object as it is simulated, without those of our own numerics."""
    return frozenset(_families(making)) - ANY_NUMERICS


@cache
def _families(making: Making) -> Mapping[str, Family]:
    """Family of each cause of the object as it is simulated."""
    subject = subject_of(load(name_with_dynamics(making.task, making.dynamics)))
    return {cause.name: cause.family for cause in subject.catalogue().causes}


def _hideable(making: Making) -> frozenset[str]:
    """Effects of MuJoCo's world; where there are no images, those that act on what else is recorded."""
    return frozenset(
        name
        for name, effect in injectable_effects().items()
        if making.body in effect.bodies
        and (
            making.images
            or effect.in_world
            or any(hook is not None for hook in (effect.drive, effect.late_s, effect.more))
        )
    )
