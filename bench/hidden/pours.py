"""Recordings of water or soup in the simulated cell's world, as clouds and without images, with effects hidden in them.

The bowls' friction, the table's, and the liquid's bulk modulus are drawn, as are the pours. Water has a third of the
cell's drops, soup four tenths, on cells and in time steps that are longer with their distance: a pour then takes a few
seconds. Cameras are a noise of the level; what acts on images alone cannot be hidden here.
"""

from dataclasses import dataclass, field, replace
from typing import Final, Literal, TypeAlias, final, get_args

import numpy as np
from jaxtyping import Float64

from app.core.geometry.scene_description import Liquid, Soup
from app.core.types import Cloud
from app.discovery.dataset.study import ProjectionView, Study
from app.perception.body.resample import resample
from app.perception.body.vessels import Pool
from app.policy.random_pours import pour_design
from app.policy.random_pushes import PushDesign
from app.rig.simulated.effect_sampling import mistune
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.push_session import PushSession, StampedSnapshot
from app.rig.simulated.worlds.effect_injector import Intrusion
from app.rig.simulated.worlds.liquid_world import particles
from app.rig.simulated.worlds.physics import WorldPhysics
from app.tasks import load
from app.tasks.elements.base import Nodes, Task
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
class PourCase:
    """A recording to be made: a seed, from which all else is drawn, and the hidden effects.

    `of`: the task. `noise_m`: of the depth that levels are taken for.
    """

    seed: int
    of: Poured = "pour_water"
    hidden: tuple[Chosen, ...] = ()
    plan: PushDesign = field(default_factory=lambda: pour_design(8, 3))
    noise_m: float = USUAL_NOISE_M

    @property
    def task(self) -> Task:
        """The task, its world with fewer drops."""
        task = load(self.of)
        body = _coarse(task)
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
    """The liquid as cameras and their reconstruction show it, with so many times the cell's noise.

    It stands in the fixed bowl to its level; the rest is where the kinematics have the held one. Pieces in it are seen
    where they are not under that level. `more`: the share of what the task says by which there is more of it, which
    nobody sees.
    """
    fixed, held = task.perception.standing[0], task.perception.held
    volume_m3, nodes = task.perception.volume_m3, look.snapshot.nodes
    assert held is not None
    assert look.told is not None
    place = np.array(fixed.place_m)
    aside = np.linalg.norm(nodes - look.snapshot.tool[:3], axis=1) > held.radius_m + _wall_m(task)
    inside = aside & (np.linalg.norm(nodes - place, axis=1) < fixed.radius_m)
    poured_m3 = float(_volumes_m3(task, len(nodes), more) @ inside)
    pools = list[Pool]()
    if poured_m3 > _LEAST * volume_m3:
        level_m = fixed.pool(poured_m3).level_m + scale * _LEVEL_M * rng.standard_normal()
        pools.append(Pool(vessel=fixed, level_m=float(level_m)))
    left_m3 = volume_m3 - sum(pool.volume_m3 for pool in pools)
    if left_m3 > _LEAST * volume_m3:
        pools.append(held.at(look.told).pool(left_m3))
    spacing_m = float(np.cbrt(volume_m3 / _POINTS))
    body, seed = np.concatenate([pool.points(spacing_m) for pool in pools]), int(rng.integers(2**31))
    count, swimming = task.preset("cpu").particle_count, task.perception.swimming
    if swimming is None:
        return ProjectionView(time_s=look.stamp_s, points=resample(body, count, seed=seed))
    level_m = max((pool.level_m for pool in pools if pool.vessel == fixed), default=fixed.place_m[2] - fixed.radius_m)
    tops = _tops(task, nodes)
    hidden = (np.linalg.norm(tops - place, axis=1) < fixed.radius_m) & (tops[:, 2] < level_m)
    parts = zip(swimming.apart(body, tops[~hidden]), swimming.split(count), strict=True)
    points = np.concatenate([resample(part, own, seed=seed) for part, own in parts])
    return ProjectionView(time_s=look.stamp_s, points=points)


def _tops(task: Task, nodes: Nodes) -> Cloud:
    """Tops of the pieces in a soup, above the middles of each."""
    soup = task.stage.body
    assert isinstance(soup, Soup)
    tops, begin = list[Nodes](), particles(soup, len(nodes))[0]
    for kind in soup.pieces:
        middles = nodes[begin : begin + kind.grains].reshape(kind.count, -1, 3).mean(axis=1)
        tops.append(middles + np.array([0.0, 0.0, kind.edge_m / 2]))
        begin += kind.grains
    return np.concatenate(tops).astype(np.float32)


def _wall_m(task: Task) -> float:
    return float(task.stage.tool.bowl_m or 0.0) - (task.perception.held.radius_m if task.perception.held else 0.0)


def _volumes_m3(task: Task, count: int, more: float) -> Float64[np.ndarray, " K"]:
    """Volume of each of so many nodes, of which those of pieces are last."""
    body = task.stage.body
    assert isinstance(body, Liquid | Soup)
    filled = body.with_more(more * body.volume_m3)
    counts = particles(filled, count)
    solid = [kind.volume_m3 for kind in filled.pieces] if isinstance(filled, Soup) else []
    shares = np.array([filled.volume_m3 - sum(solid), *solid]) / counts
    return np.repeat(shares, counts)


def _coarse(task: Task) -> Liquid | Soup:
    """The task's liquid of fewer drops; a soup's are of the volume of its grains."""
    match task.stage.body:
        case Liquid() as water:
            return replace(water, drops=DROPS)
        case Soup() as soup:
            drops = round(soup.liquid.drops * (_ALONG / soup.along) ** 3)
            pieces = tuple(replace(kind, along=_ALONG) for kind in soup.pieces)
            return replace(soup, liquid=replace(soup.liquid, drops=drops), pieces=pieces)
        case body:
            raise TypeError(f"{task.name} pours no liquid, but {type(body).__name__}.")
