"""Recordings of water or soup in the simulated cell's world, as clouds and without images, with effects hidden in them.

The bowls' friction, the table's, and the liquid's bulk modulus are drawn, as are the pours. Water has a third of the
cell's drops, soup four tenths, on cells and in time steps that are longer with their distance: a pour then takes a few
seconds. Cameras are a noise of the level; what acts on images alone cannot be hidden here.
"""

from dataclasses import dataclass, field, replace
from typing import Final, Literal, TypeAlias, final, get_args

import numpy as np

from app.core.geometry.scene_description import Liquid, Soup
from app.discovery.dataset.study import ProjectionView, Study
from app.evaluation.pour_view import LEVEL_M, seen_pour
from app.policy.random_pours import pour_design
from app.policy.random_pushes import PushDesign
from app.rig.simulated.effect_sampling import mistune
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.push_session import PushSession, StampedSnapshot
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.physics import WorldPhysics
from app.tasks import load
from app.tasks.elements.base import Task
from app.tasks.elements.pouring import PouringProblems
from app.tasks.elements.swimming import SoupProblems
from bench.hidden.draws import Chosen, effects_of
from bench.hidden.ropes import USUAL_NOISE_M
from bench.hidden.unrendered import study_of
from bench.rehearsal import rehearse

Poured: TypeAlias = Literal["pour_soup", "pour_water"]
POURED: Final[tuple[Poured, ...]] = get_args(Poured)
"""Tasks in which something is poured."""
DROPS: Final = 800
"""Drops of water."""
_ALONG: Final = 3
"""Grains along the edge of a piece of soup, whose drops are as large."""
_SEEN: Final = 12
"""Stream of random numbers of a seed."""


@final
@dataclass(frozen=True, kw_only=True)
class PourCase:
    """A recording to be made: a seed, from which all else is drawn, and the hidden effects.

    `of`: the task. `noise_m`: of the depth that levels are taken for.
    """

    seed: int
    of: Poured = "pour_water"
    hidden: tuple[Chosen, ...] = ()
    plan: PushDesign = field(default_factory=lambda: pour_design(8, 3))
    noise_m: float = USUAL_NOISE_M
    drops: int = DROPS
    """Those of water; the cell's has three times as many."""

    @property
    def task(self) -> Task:
        """The task, its world with fewer drops."""
        task = load(self.of)
        body = _coarse(task, self.drops)
        problems: PouringProblems | SoupProblems
        match body, task.problems:
            case Liquid(), PouringProblems() as known:
                problems = replace(known, liquid=body)
            case Soup(), SoupProblems() as known:
                problems = replace(known, soup=body)
            case _:
                raise TypeError(f"{task.name} pours no liquid.")
        return replace(task, stage=replace(task.stage, body=body), problems=problems)

    @property
    def physics(self) -> WorldPhysics:
        """The world's: frictions and bulk modulus off by up to 30 %."""
        return mistune(self.seed, body=self.task.stage.body)

    @property
    def injected(self) -> tuple[InjectedEffect, ...]:
        """The effects, with directions and signs of their own."""
        return effects_of(self.hidden, self.seed, type(self.task.stage.body))

    def session(self) -> PushSession:
        """The world and its arm, to pour in as one likes."""
        return PushSession(self.task, self.plan, self.physics, self.injected, self.seed)

    def record(self) -> Study:
        """The pours as discovery reads them."""
        task, rng = self.task, np.random.default_rng([self.seed, _SEEN])
        scale = self.noise_m / USUAL_NOISE_M
        takes = rehearse(task, self.plan, self.physics, self.injected, self.seed)
        more = Intrusion(self.injected).more
        return study_of(task, takes, lambda look: view_of_pour(task, look, rng, scale, more), rng)


def view_of_pour(
    task: Task, look: StampedSnapshot, rng: np.random.Generator, scale: float = 1.0, more: float = 0.0
) -> ProjectionView:
    """The liquid as cameras and their reconstruction show it, with so many times the cell's noise: see `seen_pour`."""
    assert look.told is not None
    points = seen_pour(
        task,
        look.snapshot.nodes,
        task.preset("cpu").particle_count,
        rng,
        tip=look.snapshot.tool,
        told=look.told,
        more=more,
        level_m=scale * LEVEL_M,
    )
    return ProjectionView(time_s=look.stamp_s, points=points)


def _coarse(task: Task, count: int) -> Liquid | Soup:
    """The task's liquid of `count` drops; a soup's are of the volume of its grains."""
    match task.stage.body:
        case Liquid() as water:
            return replace(water, drops=count)
        case Soup() as soup:
            drops = round(soup.liquid.drops * (_ALONG / soup.along) ** 3)
            pieces = tuple(replace(kind, along=_ALONG) for kind in soup.pieces)
            return replace(soup, liquid=replace(soup.liquid, drops=drops), pieces=pieces)
        case body:
            raise TypeError(f"{task.name} pours no liquid, but {type(body).__name__}.")
