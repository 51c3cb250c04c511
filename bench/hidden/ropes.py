"""Recordings of ropes of any size in MuJoCo's world, as clouds and without images, with an effect hidden in them.

Nothing in it is as the task has it: rope, finger, stiffness and frictions are drawn. Cameras are a noise of centrelines
(0.8 mm, as the cell's cameras show open ropes: `python -m bench.centrelines`) and of points. What acts on images alone
cannot be hidden here.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Final, final

import numpy as np

from app.core.stage import RopeModel
from app.core.task_name import recorded
from app.core.types import Cloud
from app.discovery.centreline_noise import smooth_noise
from app.discovery.study import Push, Study, View
from app.perception.resample import resample
from app.policy.strokes import REGION, Plan
from app.rig.simulated.hidden.base import Injected
from app.rig.simulated.hiding import Wish, draw, known, mistuned
from app.rig.simulated.physics import WorldPhysics
from app.rig.simulated.rehearsal import Look, Rehearsal, Take, rehearse
from app.tasks import load
from app.tasks.base import Task
from app.tasks.curves import fill_tube
from bench.hidden.draws import Chosen

RADIUS_M: Final = 0.004, 0.010
LENGTH_M: Final = 0.25, 0.60
MASS_KG: Final = 0.015, 0.100
FINGER_M: Final = 0.005, 0.012
SOFTER: Final = 0.5, 2.0
"""Bending rigidity, as a multiple of a limp rope's of that radius."""
_LIMP_N_M2: Final = 6e-5
"""Of the cell's rope of 8 mm radius."""
_YIELD_1_M: Final = 5.0
"""Curvature beyond which a rope keeps its bend: the chain's."""
_LINE_M, _POINT_M = 0.8e-3, 0.4e-3
_DENSE: Final = 2
_TIP_M, _TIP_POINTS = 1e-3, 60
_TABLE_POINTS: Final = 400
_SIZES, _SEEN = 11, 12
"""Streams of random numbers of a seed."""


@final
@dataclass(frozen=True, kw_only=True)
class RopeCase:
    """A recording to be made: a seed, from which all else is drawn, and what is hidden.

    In a `world` of cables only errors of the arm can be hidden.
    """

    seed: int
    world: RopeModel = "chain"
    hidden: tuple[Chosen, ...] = ()
    plan: Plan = field(default_factory=Plan)

    @property
    def task(self) -> Task:
        """The task of this rope and finger, simulated as a rod."""
        rng = np.random.default_rng([self.seed, _SIZES])
        sizes = {
            "radius_m": rng.uniform(*RADIUS_M),
            "length_m": rng.uniform(*LENGTH_M),
            "mass_kg": np.exp(rng.uniform(*np.log(MASS_KG))),
            "finger_radius_m": rng.uniform(*FINGER_M),
        }
        given = ",".join(f"{name}={value:.5g}" for name, value in sizes.items())
        return load(f"rope_push({given})@rods")

    @property
    def physics(self) -> WorldPhysics:
        """The world's: frictions off by up to 30 %, a rigidity in proportion to the fourth power of the radius."""
        task, made = self.task, mistuned(self.seed, self.world)
        rng = np.random.default_rng([self.seed, _SIZES, 1])
        segment_m = task.rope.length_m / made.rope.segments
        assert task.rods is not None
        limp = task.rods.scene.nominal_physics()["rigidity"]
        if made.cable is not None:
            rigidity = made.cable.rigidity_n_m2 * limp / _LIMP_N_M2 * np.exp(rng.uniform(*np.log(SOFTER)))
            return replace(made, cable=replace(made.cable, rigidity_n_m2=float(rigidity)))
        rope = replace(
            made.rope,
            bend_stiffness_n_m_rad=limp * np.exp(rng.uniform(*np.log(SOFTER))) / segment_m,
            bend_damping_n_m_s_rad=made.rope.bend_damping_n_m_s_rad * limp / _LIMP_N_M2,
            bend_yield_rad=_YIELD_1_M * segment_m,
        )
        return replace(made, rope=rope)

    @property
    def injected(self) -> tuple[Injected, ...]:
        """The effects, with directions, places and signs of their own."""
        files = known()
        wishes = [Wish(each.effect, each.size * float(files[each.effect].main.typical or 0.0)) for each in self.hidden]
        return draw(wishes, self.seed)

    def session(self) -> Rehearsal:
        """The world and its arm, to push in as one likes."""
        return Rehearsal(self.task, self.plan, self.physics, self.injected, self.seed)

    def record(self) -> Study:
        """The pushes as discovery reads them."""
        task, rng = self.task, np.random.default_rng([self.seed, _SEEN])
        takes = rehearse(task, self.plan, self.physics, self.injected, self.seed)
        pushes = tuple(_pushes(task, takes, rng))
        return Study(task=recorded(task.name), pushes=pushes, tables={each.episode: bare_table(rng) for each in pushes})


def view_of(task: Task, look: Look, rng: np.random.Generator) -> View:
    """The rope as cameras and their reconstruction show it."""
    nodes, count = look.snapshot.nodes.copy(), task.preset("cpu").particle_count
    nodes[:, :2] += smooth_noise(rng, np.linspace(-1, 1, len(nodes)), _LINE_M)
    nodes[:, 2] = task.rope.radius_m
    body = fill_tube(nodes, task.rope.radius_m, _DENSE * count)
    seen = (body + rng.normal(0, _POINT_M, body.shape)).astype(np.float32)
    return View(time_s=look.stamp_s, points=resample(seen, count, seed=int(rng.integers(2**31))))


def push_of(task: Task, before: View, take: Take, rng: np.random.Generator) -> Push:
    """A push as discovery reads it, with the view from which it was chosen."""
    tip = take.during.snapshot.tip + rng.normal(0, _TIP_M, (_TIP_POINTS, 3))
    return Push(
        episode=take.episode,
        before=before,
        during=(replace(view_of(task, take.during, rng), finger=tip.astype(np.float32)),),
        after=view_of(task, take.after, rng),
        command=take.command,
        measured=take.measured,
    )


def bare_table(rng: np.random.Generator) -> Cloud:
    """Points of the bare table [m]."""
    level = np.zeros((_TABLE_POINTS, 3))
    level[:, :2] = rng.uniform(REGION[:2], REGION[2:], (_TABLE_POINTS, 2))
    return (level + rng.normal(0, _TIP_M, level.shape)).astype(np.float32)


def _pushes(task: Task, takes: Iterable[Take], rng: np.random.Generator) -> Iterator[Push]:
    for take in takes:
        tip = take.during.snapshot.tip + rng.normal(0, _TIP_M, (_TIP_POINTS, 3))
        yield Push(
            episode=take.episode,
            before=view_of(task, take.before, rng),
            during=(replace(view_of(task, take.during, rng), finger=tip.astype(np.float32)),),
            after=view_of(task, take.after, rng),
            command=take.command,
            measured=take.measured,
        )
