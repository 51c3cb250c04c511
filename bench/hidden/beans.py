"""Recordings of beans in MuJoCo's world, as clouds and without images, with an effect hidden in them.

Frictions of table and paddle and the beans' resistance to rolling are drawn, as are the places where they lie. Cameras
are a noise of what is seen of the beans from above; what acts on images alone cannot be hidden here.
"""

from dataclasses import dataclass, field
from typing import Final, final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.scene_description import Beans
from app.core.types import Points
from app.discovery.dataset.study import ProjectionView, Study
from app.perception.body.fill import fill, points_inside
from app.perception.body.resample import resample
from app.policy.random_pushes import PushDesign
from app.policy.random_sweeps import sweep_design
from app.rig.simulated.effect_sampling import mistune
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.push_session import PushSession, StampedSnapshot
from app.rig.simulated.worlds.physics import WorldPhysics
from app.rig.simulated.worlds.world import Nodes
from app.tasks import load
from app.tasks.elements.base import Task
from bench.hidden.draws import Chosen, effects_of
from bench.hidden.ropes import USUAL_NOISE_M
from bench.hidden.unrendered import study_of
from bench.rehearsal import rehearse

_BEAN_M, _POINT_M = 0.3e-3, 0.4e-3
"""Noise of a bean's place, which all of its points share, and of each point: clouds then differ from one another and
from the true beans by as much as those of the cell's two rendered cameras do, within 5 % (kernel means of 4 and 8 mm
over 8 views)."""
_ROUND: Final = 140
"""Points on the surface of a bean."""
_CELL_M, _SKIN_M = 2e-3, 3e-3
"""Cells of the table of which the highest points are seen, and how far below them others are, too."""
_FULL: Final = 6000
"""Points of the body under the surface."""
COUNT: Final = 30, 70
BEAN_KG: Final = 0.5e-3, 2e-3
"""Mass of one bean."""
_SIZES, _SEEN = 11, 12
"""Streams of random numbers of a seed."""


@final
@dataclass(frozen=True, kw_only=True)
class BeanCase:
    """A recording to be made: a seed, from which all else is drawn, and the hidden effects.

    `noise_m`: of the depth that clouds are taken for. `other_beans`: their number and mass are drawn, too; else they
    are the task's.
    """

    seed: int
    hidden: tuple[Chosen, ...] = ()
    plan: PushDesign = field(default_factory=lambda: sweep_design(8, 8))
    noise_m: float = USUAL_NOISE_M
    other_beans: bool = False

    @property
    def task(self) -> Task:
        """The task of these beans."""
        if not self.other_beans:
            return load("bean_sweep")
        rng = np.random.default_rng([self.seed, _SIZES])
        count = int(rng.integers(COUNT[0], COUNT[1] + 1))
        mass_kg = count * float(np.exp(rng.uniform(*np.log(BEAN_KG))))
        return load(f"bean_sweep(count={count},mass_kg={mass_kg:.4g})")

    @property
    def physics(self) -> WorldPhysics:
        """The world's: frictions and rolling resistance off by up to 30 %."""
        return mistune(self.seed, body=_beans(self.task))

    @property
    def injected(self) -> tuple[InjectedEffect, ...]:
        """The effects, with directions, places and signs of their own."""
        return effects_of(self.hidden, self.seed, Beans)

    def session(self) -> PushSession:
        """The world and its arm, to sweep in as one likes."""
        return PushSession(self.task, self.plan, self.physics, self.injected, self.seed)

    def record(self) -> Study:
        """The sweeps as discovery reads them."""
        task, rng = self.task, np.random.default_rng([self.seed, _SEEN])
        scale = self.noise_m / USUAL_NOISE_M
        takes = rehearse(task, self.plan, self.physics, self.injected, self.seed)
        return study_of(task, takes, lambda look: view_of_beans(task, look, rng, scale), rng)


def view_of_beans(task: Task, look: StampedSnapshot, rng: np.random.Generator, scale: float = 1.0) -> ProjectionView:
    """The beans as cameras and their reconstruction show them, with so many times the cell's noise."""
    return ProjectionView(time_s=look.stamp_s, points=seen_beans(task, look.snapshot.nodes, rng, scale))


def seen_beans(task: Task, nodes: Nodes, rng: np.random.Generator, scale: float) -> Points:
    """The cloud of beans of these nodes [m], two a bean: the body under what is seen from above, in the cameras' box.

    Raises ValueError if no bean is left there.
    """
    beans, how, count = _beans(task), task.perception, task.preset("cpu").particle_count
    pieces = nodes.reshape(-1, 2, 3)
    pieces = pieces[how.box.holds(pieces.mean(1).astype(np.float32))]
    if not len(pieces):
        raise ValueError("All beans have left the table; draw another seed.")
    surface = _on_surfaces(pieces, beans, rng)
    highest = _from_above(surface.reshape(-1, 3)).reshape(surface.shape[:2])
    level = scale * _BEAN_M * np.append(rng.standard_normal((len(pieces), 2)), np.zeros((len(pieces), 1)), axis=1)
    surface = surface + level[:, None] + rng.normal(0, scale * _POINT_M, surface.shape)
    solid = fill(
        surface[highest].astype(np.float32),
        table_m=how.table_m,
        half_width_m=how.half_width_m,
        underside=how.underside,
    )
    body = points_inside(solid, float(np.cbrt(solid.volume_m3 / _FULL)))
    return resample(body, count, seed=int(rng.integers(2**31)))


def _on_surfaces(
    pieces: Float64[np.ndarray, "C 2 3"], beans: Beans, rng: np.random.Generator
) -> Float64[np.ndarray, "C P 3"]:
    """Points evenly on the upper sides of the beans [m]."""
    way, size = pieces[:, 1] - pieces[:, 0], (len(pieces), _ROUND)
    round_m, straight_m = 2 * beans.radius_m, beans.length_m - 2 * beans.radius_m
    # Of a sphere's surface, equal parts lie between equally distant levels, as of a cylinder about it.
    at = rng.uniform(-round_m - straight_m, round_m + straight_m, size) / 2
    on_side = np.abs(at) < straight_m / 2
    cap = np.where(on_side, 0.0, np.abs(at) - straight_m / 2) / beans.radius_m
    angle, out = rng.uniform(0, 2 * np.pi, size), np.sqrt(1 - cap**2) * beans.radius_m
    along = way / np.linalg.norm(way, axis=1, keepdims=True)
    side = np.cross(along, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    up = np.cross(side, along)
    points = pieces.mean(1)[:, None] + at[..., None] * along[:, None]
    points += (out * np.cos(angle))[..., None] * side[:, None] + (out * np.abs(np.sin(angle)))[..., None] * up[:, None]
    return points


def _from_above(points: Float64[np.ndarray, "M 3"]) -> np.ndarray:
    """Mask of the points that no other lies over."""
    cells = np.floor(points[:, :2] / _CELL_M).astype(np.int64)
    _, cell = np.unique(cells, axis=0, return_inverse=True)
    top = np.full(cell.max() + 1, -np.inf)
    np.maximum.at(top, cell, points[:, 2])
    return points[:, 2] > top[cell] - _SKIN_M


def _beans(task: Task) -> Beans:
    assert isinstance(task.stage.body, Beans)
    return task.stage.body
