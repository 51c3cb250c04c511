"""Recordings of ropes of any size made by our own rod with other numerics and another contact, without images.

Nodes are nearer to one another and time steps half as long, which makes contacts of most ropes four times as stiff. The
finger's contact, the table's creep, the rope's mass and how it keeps its bends are drawn, as are friction and rigidity.
What cameras and arm get wrong acts as discovery's apparatus has it. Rods keep their state from push to push.
"""

from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property, lru_cache
from math import ceil
from typing import Final, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float64
from scipy.spatial import KDTree

from app.core.task_name import recorded_name
from app.core.types import Cloud
from app.discovery.dataset.model_under_test import RodModel, Subject
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.steppers import contact_of
from app.discovery.sensor_actuator_errors.base import Eye
from app.jobs.discovery_subject import subject_of
from app.policy.random_pushes import PushDesign
from app.rig.simulated.testbeds.rope_push import lay_out
from app.rig.simulated.worlds.physics import Centreline
from app.rig.simulated.worlds.rope import resample
from app.sim.effects.base import Effect
from app.sim.model.numerics import ROD_NUMERICS
from app.sim.model.params import PARAMETERS, acting
from app.sim.rods.effect import RodSetting
from app.sim.rods.from_parameters import rod_columns, rod_physics
from app.sim.rods.rollout import RodPhysics, make_rod_rollout
from app.sim.rods.scene import RodScene
from app.sim.rods.state import RodState, inextensible
from app.tasks import load
from app.tasks.elements.base import Task
from bench.hidden.draws import Chosen
from bench.hidden.outside import OUTSIDE
from bench.hidden.own import Order, World, world_of
from bench.hidden.ropes import USUAL_NOISE_M, bare_table, seen_rope, seen_tip
from bench.hidden.sizes import drawn_task
from bench.own_world import CAMERA_M, PAUSE_S, Move, move_of

_NEARER: Final = 0.7
"""Distance of nodes, as a share of the model's."""
_SHORTER: Final = 0.5
"""Time step, as a share of the model's."""
_CREEP: Final = 3.0
"""The table's creep is up to so many times as fast, or as slow."""
_BLOCK: Final = 512
"""Time steps, of which every path is a whole number: few shapes are compiled."""
_CONTACT, _SEEN, _STARTS = 21, 22, 23
"""Streams of random numbers of a seed."""


@final
@dataclass(frozen=True, kw_only=True)
class OwnRope:
    """A recording to be made: a seed, from which all else is drawn, and the hidden effects.

    `flat`: the chance that the finger is a flat gripper; `noise_m`: of the depth that clouds are taken for.
    """

    seed: int
    hidden: tuple[Chosen, ...] = ()
    plan: PushDesign = field(default_factory=PushDesign)
    flat: float = 0.0
    noise_m: float = USUAL_NOISE_M

    @cached_property
    def task(self) -> Task:
        """The task of this rope and finger, simulated as a rod."""
        return load(drawn_task(self.seed, "rods", flat=self.flat))

    @cached_property
    def subject(self) -> Subject:
        """The model that is doubted."""
        return subject_of(self.task)

    @cached_property
    def world(self) -> World:
        """Hidden parameters; friction and rigidity are off by up to 30 % in any case."""
        hidden = tuple((each.effect, each.size) for each in self.hidden)
        order = Order(name="own", seed=self.seed, hidden=hidden)
        return world_of(order, self.subject.catalogue(), self.subject)

    @property
    def rods(self) -> RodModel:
        """The rod of the world: other numerics, another contact, a rope that is another one."""
        assert self.subject.rods is not None
        scene, rng = self.subject.rods.scene, np.random.default_rng([self.seed, _CONTACT])
        steps = [rng.uniform(max(unknown.low, -1.0), 1.0) for unknown in ROD_NUMERICS.values()]
        contact = contact_of(self.subject.rods, jnp.array([steps]))
        contact["creep"] = scene.nominal_physics()["creep"] * _CREEP ** rng.uniform(-1, 1)
        finer = replace(scene, spacing_m=_NEARER * scene.spacing_m, dt_s=_SHORTER * scene.dt_s)
        numbers = tuple((name, float(np.ravel(value)[0])) for name, value in contact.items())
        return RodModel(scene=finer, contact=numbers)

    def record(self) -> Study:
        """The pushes as a study. Raises ValueError if the rod leaves the range that it can simulate."""
        rng = np.random.default_rng([self.seed, _SEEN])
        predictor = Predictor(self.subject, self.subject.catalogue())
        pushes = tuple(self._pushes(predictor, rng))
        tables = {each.episode: self._shown(predictor, bare_table(rng), None) for each in pushes}
        return Study(task=recorded_name(self.task.name), pushes=pushes, tables=tables, camera=CAMERA_M)

    def _pushes(self, predictor: Predictor, rng: np.random.Generator) -> Iterator[Push]:
        starts = np.random.default_rng([self.seed, _STARTS]).integers(2**31, size=self.plan.episodes).tolist()
        total, now_s, rod, ends = self.plan.episodes * self.plan.pushes, 0.0, _Rod(self.rods, self.world), None
        for number in range(total):
            episode, push = divmod(number, self.plan.pushes)
            if push == 0:
                rod.lay(lay_out(self.task.start(starts[episode]), ends))
            before = rod.line()
            move = move_of(rng, predictor, self.plan, before.astype(np.float32), self.world.theta, now_s)
            session = number / max(total - 1, 1) - 0.5
            lines = [before, *(rod.moved(path, session) for path in _paths(move, rod.scene.dt_s))]
            rod.rest()
            ends, now_s = lines[-1][[0, -1], :2], move.end_s + PAUSE_S
            yield self._push(rng, predictor, episode, move, lines)

    def _push(
        self,
        rng: np.random.Generator,
        predictor: Predictor,
        episode: int,
        move: Move,
        lines: Sequence[Centreline],
    ) -> Push:
        scale = self.noise_m / USUAL_NOISE_M
        before, during, after = (
            seen_rope(self.task, line, rng, scale, lambda body, line=line: self._shown(predictor, body, line))
            for line in lines
        )
        finger = self._shown(predictor, seen_tip(move.true.at(np.array([move.shown_s]))[0], rng), None)
        return Push(
            episode=episode,
            before=ProjectionView(time_s=float(move.command.times_s[0]), points=before),
            during=(ProjectionView(time_s=move.view_s, points=during, finger=finger),),
            after=ProjectionView(time_s=move.end_s, points=after),
            command=move.command,
            measured=move.measured(rng),
        )

    def _shown(self, predictor: Predictor, points: Cloud, line: Centreline | None) -> Cloud:
        """Points as cameras that err show them; `line`: the middle of the object that they are of."""
        middle = None
        if line is not None:
            fine = resample(line, 8 * len(line))
            middle = fine[np.asarray(KDTree(fine).query(points)[1])]
        return predictor.observe(points, Eye(np.asarray(CAMERA_M), middle), self.world.theta)


def _paths(move: Move, step_s: float) -> tuple[Float64[np.ndarray, "T 3"], Float64[np.ndarray, "S 3"]]:
    """The tip's places at time steps to the moment that a view shows, and from there to the end."""
    before = _BLOCK * ceil((move.shown_s - move.command.times_s[0]) / step_s / _BLOCK)
    behind = _BLOCK * ceil((move.end_s - move.shown_s) / step_s / _BLOCK)
    first = move.true.at(move.shown_s - step_s * np.arange(before, -1, -1))
    return first, move.true.at(move.shown_s + step_s * np.arange(behind + 1))


@final
class _Rod:
    """A rod on a table that keeps its state."""

    def __init__(self, model: RodModel, world: World) -> None:
        self.scene, self._contact = model.scene, model.contact
        phi = world.theta[: len(PARAMETERS)].astype(np.float32)
        effects = tuple(effect for effect in acting(phi) if effect.rod is not None)
        outside = tuple(OUTSIDE.values()) if world.strange else ()
        self._phi = phi[None], np.concatenate([phi[rod_columns(effects)], world.beyond if world.strange else ()])[None]
        self._step = _stepper(self.scene, (*effects, *outside))
        self._state: RodState | None = None

    def lay(self, line: Centreline) -> None:
        """A new rope along this line, at rest."""
        nodes = resample(line, self.scene.nodes)[:, :2].T[None]
        self._state = RodState.along(inextensible(jnp.asarray(nodes, jnp.float32), self.scene.rest_m))

    def line(self) -> Centreline:
        """Positions of its nodes [m] with the radius. Raises ValueError if they are lost."""
        assert self._state is not None
        nodes = np.asarray(self._state.centreline[0], np.float64).T
        if not np.isfinite(nodes).all():
            raise ValueError("The rod of the world left what it can simulate; draw another seed.")
        return np.column_stack([nodes, np.full(len(nodes), self.scene.radius_m)])

    def moved(self, path: Float64[np.ndarray, "T 3"], session: float) -> Centreline:
        """Positions of its nodes after the tip has followed a path, a place a time step."""
        assert self._state is not None
        physics = rod_physics(self.scene, dict(self._contact), jnp.asarray(self._phi[0]))
        for first in range(0, len(path) - 1, _BLOCK):
            tool = path[None, first : first + _BLOCK + 1].astype(np.float32)
            self._state = self._step(physics, self._state, tool, self._phi[1].astype(np.float32), np.array([session]))
        return self.line()

    def rest(self) -> None:
        """Take its motion."""
        assert self._state is not None
        self._state = self._state.resting()


@lru_cache(maxsize=4)
def _stepper(scene: RodScene, effects: tuple[Effect, ...]) -> Callable[..., RodState]:
    simulate = make_rod_rollout(scene, effects)
    along = jnp.linspace(-1.0, 1.0, scene.nodes)[None]

    @jax.jit
    def stepped(physics: RodPhysics, state: RodState, tool: jax.Array, phi: jax.Array, time: jax.Array) -> RodState:
        return simulate(physics, state, tool, phi, RodSetting(material_coordinates=along, session_time=time))

    return stepped
