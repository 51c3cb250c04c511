"""Recordings of water in the simulated cell's world, as clouds and without images, with an effect hidden in them.

The bowls' friction, the table's, and the water's bulk modulus are drawn, as are the pours. The water has a third of the
cell's drops, on cells and in time steps that are longer with their distance: a pour then takes a few seconds. Cameras
are a noise of the level; what acts on images alone cannot be hidden here.
"""

from dataclasses import dataclass, field, replace
from typing import Final, final

import numpy as np

from app.core.geometry.scene_description import Liquid
from app.discovery.dataset.study import ProjectionView, Study
from app.perception.body.resample import resample
from app.perception.body.vessels import Pool
from app.policy.random_pours import pour_design
from app.policy.random_pushes import PushDesign
from app.rig.simulated.effect_sampling import mistune
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.push_session import PushSession, StampedSnapshot
from app.rig.simulated.worlds.physics import WorldPhysics
from app.tasks import load
from app.tasks.elements.base import Task
from app.tasks.elements.pouring import PouringProblems
from bench.hidden.draws import Chosen, effects_of
from bench.hidden.ropes import USUAL_NOISE_M
from bench.hidden.unrendered import study_of
from bench.rehearsal import rehearse

DROPS: Final = 800
_LEVEL_M: Final = 0.5e-3
"""Noise of a level that two rendered cameras see."""
_POINTS: Final = 4000
"""Points of the liquid that its particles are means of."""
_LEAST: Final = 0.02
"""Share of the liquid below which a level is not seen."""
_SEEN: Final = 12
"""Stream of random numbers of a seed."""


@final
@dataclass(frozen=True, kw_only=True)
class WaterCase:
    """A recording to be made: a seed, from which all else is drawn, and the hidden effects.

    `noise_m`: of the depth that levels are taken for.
    """

    seed: int
    hidden: tuple[Chosen, ...] = ()
    plan: PushDesign = field(default_factory=lambda: pour_design(8, 3))
    noise_m: float = USUAL_NOISE_M

    @property
    def task(self) -> Task:
        """The task, its world with fewer drops."""
        task = load("pour_water")
        water, problems = replace(_water(task), drops=DROPS), task.problems
        assert isinstance(problems, PouringProblems)
        return replace(task, stage=replace(task.stage, body=water), problems=replace(problems, liquid=water))

    @property
    def physics(self) -> WorldPhysics:
        """The world's: frictions and bulk modulus off by up to 30 %."""
        return mistune(self.seed, body=_water(self.task))

    @property
    def injected(self) -> tuple[InjectedEffect, ...]:
        """The effects, with directions and signs of their own."""
        return effects_of(self.hidden, self.seed, Liquid)

    def session(self) -> PushSession:
        """The world and its arm, to pour in as one likes."""
        return PushSession(self.task, self.plan, self.physics, self.injected, self.seed)

    def record(self) -> Study:
        """The pours as discovery reads them."""
        task, rng = self.task, np.random.default_rng([self.seed, _SEEN])
        scale = self.noise_m / USUAL_NOISE_M
        takes = rehearse(task, self.plan, self.physics, self.injected, self.seed)
        return study_of(task, takes, lambda look: view_of_water(task, look, rng, scale), rng)


def view_of_water(task: Task, look: StampedSnapshot, rng: np.random.Generator, scale: float = 1.0) -> ProjectionView:
    """The water as cameras and their reconstruction show it, with so many times the cell's noise.

    It stands in the fixed bowl to its level; the rest is where the kinematics have the held one.
    """
    fixed, held = task.perception.standing[0], task.perception.held
    volume_m3, nodes = task.perception.volume_m3, look.snapshot.nodes
    assert held is not None
    assert look.told is not None
    place = np.array(fixed.place_m)
    aside = np.linalg.norm(nodes - look.snapshot.tool[:3], axis=1) > held.radius_m + _wall_m(task)
    poured = float((aside & (np.linalg.norm(nodes - place, axis=1) < fixed.radius_m)).mean())
    pools = list[Pool]()
    if poured > _LEAST:
        level_m = fixed.pool(poured * volume_m3).level_m + scale * _LEVEL_M * rng.standard_normal()
        pools.append(Pool(vessel=fixed, level_m=float(level_m)))
    left_m3 = volume_m3 - sum(pool.volume_m3 for pool in pools)
    if left_m3 > _LEAST * volume_m3:
        pools.append(held.at(look.told).pool(left_m3))
    spacing_m = float(np.cbrt(volume_m3 / _POINTS))
    body = np.concatenate([pool.points(spacing_m) for pool in pools])
    points = resample(body, task.preset("cpu").particle_count, seed=int(rng.integers(2**31)))
    return ProjectionView(time_s=look.stamp_s, points=points)


def _wall_m(task: Task) -> float:
    return float(task.stage.tool.bowl_m or 0.0) - (task.perception.held.radius_m if task.perception.held else 0.0)


def _water(task: Task) -> Liquid:
    assert isinstance(task.stage.body, Liquid)
    return task.stage.body
