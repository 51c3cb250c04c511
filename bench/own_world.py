"""Recordings made by our own engine with other numerics, many at once: what discovery is tested on at scale.

Finer cells and time steps, twice the particles, wider contacts. The object keeps the shape in which it was left. Views
have a millimetre of noise and half as many points as there are particles, in any order.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from functools import lru_cache
from typing import NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float32, Float64
from scipy.interpolate import CubicSpline

from app.core.geometry.track import Track
from app.core.types import Cloud, Points
from app.discovery.dataset.model_under_test import Theta
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.discovery.residuals.predict import Predictor
from app.discovery.residuals.tool_load import resisting
from app.discovery.sensor_actuator_errors.base import Eye
from app.perception.body.resample import resample
from app.policy.random_pushes import REGION, PushDesign, midway_s, random_track
from app.sim.effects.base import Effect
from app.sim.model.catalogue import EFFECTS
from app.sim.model.params import PARAMETERS, acting, columns_of
from app.sim.model.scene import Scene
from app.sim.rods.geometry.arc_length import arclength_labels, centreline_weights
from app.sim.runtime.rollout import make_rollout
from app.sim.state import Setting, State

CAMERA_M = (0.55, -0.25, 0.95)
DENSER = 2
"""Particles of the world for one of the model."""
_NOISE_M = 1e-3
_ENCODER_M = 1e-4
_MOVED_SHARE = 0.5
"""Share of the object's weight that a push drags along: the load on a compliant tool."""
PAUSE_S, _SETTLE_S = 0.5, 0.25
_BATCH = 32
"""Substeps are rounded up to these, so that few shapes are compiled."""
_NEIGHBOURS = 41
_NODES = 24
_REST_M = 1e-4
"""Height of the lowest particle above the table."""

Step = Callable[..., tuple[jax.Array, jax.Array]]


def finer(scene: Scene) -> Scene:
    """The same scene in other numerics."""
    x, y, z = scene.low
    return replace(
        scene,
        cell_m=scene.cell_m * 2 / 3,
        low=(x, y, z * 2 / 3),
        dt_s=0.6 * scene.dt_s,
        contact_width_m=1.3 * scene.contact_width_m,
    )


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class OwnWorld:
    """Makes recordings of worlds that differ in theta alone, side by side.

    `outside`: further effects, which no catalogue knows.
    """

    predictor: Predictor
    scene: Scene
    plan: PushDesign
    outside: tuple[Effect, ...] = ()

    def record(
        self,
        truths: Sequence[Theta],
        starts: Float32[np.ndarray, "B N 3"],
        seed: int,
        beside: Float64[np.ndarray, "B Q"] | None = None,
    ) -> list[Study]:
        """One study for each truth, of an object that begins as `starts` has it [m].

        `beside`: the parameters of what is `outside`, for each truth.
        """
        rng = np.random.default_rng(seed)
        effects = _needed(truths)
        extra = np.zeros((len(truths), 0)) if beside is None else beside
        phi = np.concatenate([np.stack(truths)[:, columns_of(effects)], extra], axis=1)
        simulate = _stepper(self.scene, starts.shape[1], (*effects, *self.outside))
        x, clocks = starts.astype(np.float32), np.zeros(len(truths))
        places = np.stack([2 * arclength_labels(cloud) - 1 for cloud in x])
        sections = [_Section.of(cloud, place) for cloud, place in zip(x, places, strict=True)]
        total = self.plan.episodes * self.plan.pushes
        pushes: list[list[Push]] = [[] for _ in truths]
        for number in range(total):
            moves = [
                move_of(rng, self.predictor, self.plan, x[b], truth, float(clocks[b])) for b, truth in enumerate(truths)
            ]
            during, after = simulate(*self._inputs(phi, x, places, moves, number / max(total - 1, 1) - 0.5))
            scenes = (x, np.asarray(during), np.asarray(after))
            for b, (truth, move) in enumerate(zip(truths, moves, strict=True)):
                clouds = [self._seen(rng, cloud[b], places[b], truth) for cloud in scenes]
                pushes[b].append(self._push(rng, number // self.plan.pushes, move, clouds, truth))
                clocks[b] = move.end_s + PAUSE_S
            x = np.stack([section.around(cloud) for section, cloud in zip(sections, scenes[2], strict=True)])
        return [
            Study(
                task="rope_push",
                pushes=tuple(made),
                tables={episode: self._table(rng, truth) for episode in range(self.plan.episodes)},
                camera=CAMERA_M,
            )
            for made, truth in zip(pushes, truths, strict=True)
        ]

    def _inputs(
        self,
        phi: Float64[np.ndarray, "B P"],
        x: Float32[np.ndarray, "B N 3"],
        places: Float32[np.ndarray, "B N"],
        moves: Sequence["Move"],
        session: float,
    ) -> tuple[np.ndarray, ...]:
        step = self.scene.dt_s * self.predictor.subject.time_scale
        before = _rounded(max(move.shown_s - move.command.times_s[0] for move in moves) / step)
        behind = _rounded(max(move.end_s - move.shown_s for move in moves) / step)
        first = [move.true.at(move.shown_s - step * np.arange(before, -1, -1)) for move in moves]
        second = [move.true.at(move.shown_s + step * np.arange(behind + 1)) for move in moves]
        labels = [_labels(cloud, place) for cloud, place in zip(x, places, strict=True)]
        times = np.full(len(phi), session)
        return tuple(np.asarray(part, np.float32) for part in (phi, x, labels, times, first, second))

    def _push(
        self, rng: np.random.Generator, episode: int, move: "Move", clouds: Sequence[Points], truth: Theta
    ) -> Push:
        before, during, after = clouds
        command, tip = move.command, move.true.at(np.array([move.shown_s]))
        finger = self._shown(rng, (tip + rng.normal(0, _NOISE_M, (60, 3))).astype(np.float32), truth, None)
        measured = move.measured(rng)
        return Push(
            episode=episode,
            before=ProjectionView(time_s=float(command.times_s[0]), points=before),
            during=(ProjectionView(time_s=move.view_s, points=during, finger=finger),) if self.plan.during else (),
            after=ProjectionView(time_s=move.end_s, points=after),
            command=command,
            measured=measured if self.plan.measured else None,
        )

    def _seen(self, rng: np.random.Generator, x: Points, place: Float32[np.ndarray, " N"], truth: Theta) -> Points:
        shown = self._shown(rng, x, truth, _middles(x, place))
        return resample(shown, self.predictor.subject.particle_count, seed=int(rng.integers(2**31)))

    def _shown(
        self, rng: np.random.Generator, x: Points, truth: Theta, middle: Float64[np.ndarray, "N 3"] | None
    ) -> Points:
        shown = self.predictor.observe(x, Eye(np.asarray(CAMERA_M), middle), truth)
        return (shown + rng.normal(0, _NOISE_M, shown.shape)).astype(np.float32)

    def _table(self, rng: np.random.Generator, truth: Theta) -> Cloud:
        level = np.zeros((400, 3), np.float32)
        level[:, :2] = rng.uniform(REGION[:2], REGION[2:], (400, 2))
        return self._shown(rng, level, truth, None)


class _Section(NamedTuple):
    """The object's cross-section: each particle's offset from its point on the middle line, which has a length [m].

    `beside` (N, 3) [m]: to the left of the line, along it, and up.

    A simulator of matter lets a rope that is squeezed and left at rest grow flat, push by push. Ropes do not.
    """

    place: Float32[np.ndarray, " N"]
    beside: Float64[np.ndarray, "N 3"]
    length_m: float

    @classmethod
    def of(cls, x: Points, place: Float32[np.ndarray, " N"]) -> "_Section":
        """Section of an object at rest."""
        line = _line(x, place)
        middle, axes = _on_line(line, place)
        out = x.astype(np.float64) - middle
        return cls(place, np.einsum("nd,nad->na", out, axes), _length_m(line))

    def around(self, x: Points) -> Points:
        """The same cross-section about the middle line that the object has now, as long as it was."""
        line = _line(x, self.place)
        centre = line.mean(0)
        line = centre + (line - centre) * (self.length_m / _length_m(line))
        middle, axes = _on_line(line, self.place)
        raised = middle + np.einsum("na,nad->nd", self.beside, axes)
        raised[:, 2] -= raised[:, 2].min() - _REST_M
        return raised.astype(np.float32)


def _line(x: Points, place: Float32[np.ndarray, " N"]) -> Float64[np.ndarray, "M 3"]:
    """Nodes of the middle line, its ends extrapolated."""
    nodes = centreline_weights((place + 1) / 2, _NODES).astype(np.float64) @ x.astype(np.float64)
    first, last = 1.5 * nodes[0] - 0.5 * nodes[1], 1.5 * nodes[-1] - 0.5 * nodes[-2]
    return np.concatenate([first[None], nodes, last[None]])


def _length_m(line: Float64[np.ndarray, "M 3"]) -> float:
    return float(np.linalg.norm(np.diff(line, axis=0), axis=1).sum())


def _on_line(
    line: Float64[np.ndarray, "M 3"], place: Float32[np.ndarray, " N"]
) -> tuple[Float64[np.ndarray, "N 3"], Float64[np.ndarray, "N 3 3"]]:
    """Each particle's point on the line, and unit vectors (N, 3, 3): to the left, along, and up."""
    at = np.concatenate([[0.0], (np.arange(_NODES) + 0.5) / _NODES, [1.0]])
    share = (place.astype(np.float64) + 1) / 2
    curve = CubicSpline(at, line)
    along = curve(share, 1)
    along[:, 2] = 0
    along /= np.linalg.norm(along, axis=1, keepdims=True)
    left = np.stack([-along[:, 1], along[:, 0], np.zeros(len(share))], axis=1)
    up = np.tile([0.0, 0.0, 1.0], (len(share), 1))
    return curve(share), np.stack([left, along, up], axis=1)


class Move(NamedTuple):
    """Commanded, encoder and true tracks of a push; times of a view, of its content, and of the end."""

    command: Track
    told: Track
    true: Track
    view_s: float
    shown_s: float
    end_s: float

    def measured(self, rng: np.random.Generator) -> Track:
        """The encoders' track, with their noise."""
        told = self.told.at(self.command.times_s)
        return self.command.with_positions(told + rng.normal(0, _ENCODER_M, told.shape))


def move_of(
    rng: np.random.Generator, predictor: Predictor, plan: PushDesign, x: Points, truth: Theta, now_s: float
) -> Move:
    """The next push of an object at `x` [m], drawn at random, and what an arm that errs as `truth` has it makes of it.

    `now_s`: when the one before it was over.
    """
    subject, core_m = predictor.subject, (0.0, 0.0)
    if subject.rods is not None:
        scene = subject.rods.scene
        along = np.array([np.cos(scene.finger_yaw_rad), np.sin(scene.finger_yaw_rad)])
        core_m = tuple((scene.finger_half_width_m * along).tolist())
    start_s, height_m = now_s + PAUSE_S, subject.low_m - 0.004
    command = random_track(rng, x, plan, start_s=start_s, height_m=height_m, core_m=core_m)
    load = resisting(command, x, _MOVED_SHARE, subject)
    told = predictor.encoder_track(command, load, truth)
    true = predictor.apply_errors(command, load, truth, lambda _: True)
    view_s = midway_s(command.times_s)
    end_s = float(max(command.times_s[-1], true.times_s[-1]) + _SETTLE_S)
    return Move(command, told, true, view_s, view_s + predictor.late_s(truth), end_s)


def _rounded(substeps: float) -> int:
    return _BATCH * int(np.ceil(substeps / _BATCH))


def _middles(x: Points, place: Float32[np.ndarray, " N"]) -> Float64[np.ndarray, "N 3"]:
    """The middle of the object at each particle: the mean of its neighbours along it."""
    order, half = np.argsort(place), _NEIGHBOURS // 2
    padded = np.pad(x[order].astype(np.float64), ((half, half), (0, 0)), mode="edge")
    middle = np.empty(x.shape)
    middle[order] = np.stack(
        [np.convolve(column, np.ones(_NEIGHBOURS) / _NEIGHBOURS, "valid") for column in padded.T], 1
    )
    return middle


def _labels(x: Points, place: Float32[np.ndarray, " N"]) -> Float32[np.ndarray, "N 4"]:
    """Labels as in `state.Setting`, for known places along the object."""
    middle, order = _middles(x, place)[:, :2], np.argsort(place)
    along = np.empty_like(middle)
    along[order] = np.gradient(middle[order], axis=0)
    along /= np.maximum(np.linalg.norm(along, axis=1, keepdims=True), 1e-9)
    out = x[:, :2] - middle
    left = out[:, 1] * along[:, 0] - out[:, 0] * along[:, 1]
    return np.column_stack([place, left, along]).astype(np.float32)


def _needed(truths: Sequence[Theta]) -> tuple[Effect, ...]:
    """The effects that any of the truths has: fewer compile sooner."""
    found = [acting(truth[: len(PARAMETERS)].astype(np.float32)) for truth in truths]
    return tuple(effect for effect in EFFECTS if any(effect in own for own in found))


@lru_cache
def _stepper(scene: Scene, particles: int, effects: tuple[Effect, ...]) -> Step:
    simulate = make_rollout(scene, particle_count=particles, effects=effects)

    @jax.jit
    def stepped(
        phi: jax.Array, x: jax.Array, label: jax.Array, time: jax.Array, first: jax.Array, second: jax.Array
    ) -> tuple[jax.Array, jax.Array]:
        setting = Setting(label=label, time=time)
        shown = simulate(phi, State.at_rest(jnp.asarray(x)), first, setting)
        return shown.x, simulate(phi, shown, second, setting).x

    return stepped
