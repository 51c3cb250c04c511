"""Recordings of ropes of any size in MuJoCo's world, as clouds and without images, with an effect hidden in them.

Nothing in it is as the task has it: rope, finger, stiffness and frictions are drawn. Cameras are a noise of centrelines
(0.8 mm, as the cell's cameras show open ropes: `python -m bench.centrelines`) and of points. What acts on images alone
cannot be hidden here.
"""

from collections.abc import Callable, Iterable, Iterator
from dataclasses import dataclass, field, replace
from typing import Final, final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.scene_description import RopeModel
from app.core.task_name import recorded_name
from app.core.types import Cloud, Points
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.residuals.centreline_noise import smooth_noise
from app.perception.body.resample import resample
from app.policy.random_pushes import REGION, PushDesign
from app.rig.simulated.effect_sampling import mistune
from app.rig.simulated.injected_effects.base import InjectedEffect
from app.rig.simulated.push_session import PushSample, PushSession, StampedSnapshot
from app.rig.simulated.worlds.physics import WorldPhysics
from app.tasks import load
from app.tasks.elements.base import Task
from app.tasks.elements.curves import fill_tube
from bench.hidden.draws import Chosen, effects_of
from bench.hidden.sizes import drawn_task
from bench.rehearsal import rehearse

SOFTER: Final = 0.5, 2.0
"""Bending rigidity, as a multiple of a limp rope's of that radius."""
_LIMP_N_M2: Final = 6e-5
"""Bending rigidity of the cell's rope of 8 mm radius."""
_YIELD_1_M: Final = 5.0
"""Curvature beyond which a rope keeps its bend: the chain's."""
_LINE_M, _POINT_M = 0.8e-3, 0.4e-3
USUAL_NOISE_M: Final = 1.28e-3
"""Depth noise of the cell's cameras at their distance; centrelines found from it have the noise above."""
_DENSE: Final = 2
_TIP_M, _TIP_POINTS = 1e-3, 60
_TABLE_POINTS: Final = 400
_SIZES, _SEEN = 11, 12
"""Streams of random numbers of a seed."""


@final
@dataclass(frozen=True, kw_only=True)
class RopeCase:
    """A recording to be made: a seed, from which all else is drawn, and the hidden effects.

    In a `world` of cables only errors of the arm can be hidden. `flat`: the chance that the finger is a flat gripper;
    `noise_m`: of the depth that clouds are taken for.
    """

    seed: int
    world: RopeModel = "chain"
    hidden: tuple[Chosen, ...] = ()
    plan: PushDesign = field(default_factory=PushDesign)
    flat: float = 0.0
    noise_m: float = USUAL_NOISE_M

    @property
    def task(self) -> Task:
        """The task of this rope and finger, simulated as a rod."""
        return load(drawn_task(self.seed, "rods", flat=self.flat))

    @property
    def physics(self) -> WorldPhysics:
        """The world's: frictions off by up to 30 %, a rigidity in proportion to the fourth power of the radius."""
        task, made = self.task, mistune(self.seed, self.world)
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
    def injected(self) -> tuple[InjectedEffect, ...]:
        """The effects, with directions, places and signs of their own."""
        return effects_of(self.hidden, self.seed)

    def session(self) -> PushSession:
        """The world and its arm, to push in as one likes."""
        return PushSession(self.task, self.plan, self.physics, self.injected, self.seed)

    def record(self) -> Study:
        """The pushes as discovery reads them."""
        task, rng = self.task, np.random.default_rng([self.seed, _SEEN])
        takes = rehearse(task, self.plan, self.physics, self.injected, self.seed)
        scale = self.noise_m / USUAL_NOISE_M
        pushes = tuple(_pushes(task, takes, rng, scale))
        return Study(
            task=recorded_name(task.name), pushes=pushes, tables={each.episode: bare_table(rng) for each in pushes}
        )


def _pushes(task: Task, takes: Iterable[PushSample], rng: np.random.Generator, scale: float) -> Iterator[Push]:
    for take in takes:
        yield push_of(task, view_of(task, take.before, rng, scale), take, rng, scale)


def view_of(task: Task, look: StampedSnapshot, rng: np.random.Generator, scale: float = 1.0) -> ProjectionView:
    """The rope as cameras and their reconstruction show it, with so many times the cell's noise."""
    return ProjectionView(time_s=look.stamp_s, points=seen_rope(task, look.snapshot.nodes, rng, scale))


def push_of(task: Task, before: ProjectionView, take: PushSample, rng: np.random.Generator, scale: float = 1.0) -> Push:
    """A push as discovery reads it, with the view from which it was chosen."""
    finger = seen_tip(take.during.snapshot.tip, rng)
    return Push(
        episode=take.episode,
        before=before,
        during=(replace(view_of(task, take.during, rng, scale), finger=finger),),
        after=view_of(task, take.after, rng, scale),
        command=take.command,
        measured=take.measured,
    )


def seen_rope(
    task: Task,
    nodes: Float64[np.ndarray, "K 3"],
    rng: np.random.Generator,
    scale: float,
    shown: Callable[[Cloud], Cloud] = lambda body: body,
) -> Points:
    """The cloud of a rope along these nodes [m], its noise so many times the cell's; cameras that err have it `shown`.

    Cameras see alike for neighbours, and each point by itself; they do not see that a rope lifts off.
    """
    nodes, count = nodes.copy(), task.preset("cpu").particle_count
    nodes[:, :2] += smooth_noise(rng, np.linspace(-1, 1, len(nodes)), scale * _LINE_M)
    nodes[:, 2] = task.rope.radius_m
    body = shown(fill_tube(nodes, task.rope.radius_m, _DENSE * count))
    seen = (body + rng.normal(0, scale * _POINT_M, body.shape)).astype(np.float32)
    return resample(seen, count, seed=int(rng.integers(2**31)))


def seen_tip(tip: Float64[np.ndarray, "3"], rng: np.random.Generator) -> Cloud:
    """Points of the finger's tip [m]."""
    return (tip + rng.normal(0, _TIP_M, (_TIP_POINTS, 3))).astype(np.float32)


def bare_table(rng: np.random.Generator) -> Cloud:
    """Points of the bare table."""
    level = np.zeros((_TABLE_POINTS, 3))
    level[:, :2] = rng.uniform(REGION[:2], REGION[2:], (_TABLE_POINTS, 2))
    return (level + rng.normal(0, _TIP_M, level.shape)).astype(np.float32)
