"""Compiled simulators of a subject: batches of pushes from a cloud to the view on the way, and on to the end."""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import lru_cache
from typing import TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float, Float32

from app.discovery.dataset.model_under_test import InitialState, RodModel, Subject
from app.sim.effects.base import Effect
from app.sim.model.catalogue import EFFECTS
from app.sim.model.params import columns_of
from app.sim.model.scene import Scene
from app.sim.rods.effect import RodSetting
from app.sim.rods.from_parameters import rod_columns, rod_physics
from app.sim.rods.rollout import make_rod_rollout
from app.sim.rods.state import RodStart, RodState
from app.sim.runtime.rollout import Simulate, make_rollout
from app.sim.state import Setting, State

BLOCK = 32
"""Time steps that are compiled as one, of which every path is a whole number: few shapes are compiled."""
_CHUNKS = {"cpu": (8, 32), "gpu": (256, 512, 1024, 2048)}
_NODE_BYTES, _MOST_BYTES = 52, 3_700_000_000
"""Memory that a node of the grid of a simulation takes, as 2048 pours asked for 13.5 GiB, and the most of all."""
_ROD_CHUNKS = {"cpu": (128,), "gpu": (256, 2048)}
_TRACED = 32
"""Clouds whose centrelines are found at once."""
_SHARES = "climb", "press", "permanent_set"
"""Fields of `RodPhysics` that are from 0 to 1."""
_LEVER, _SLID_M = 2.0, 0.1
"""Bound on an object's displacement, as a multiple of the tool's path, and a slide by itself [m]."""
_LENGTHS = {"cpu": 1.0, "gpu": 2.0}
"""Ratio of one length of paths to the next: a GPU rather simulates more pushes at once, some of them for longer."""
_CARRY_LENGTHS = 1.25
"""The least of carries, no two of which take as long: to each its own length would fill chunks with repetitions."""
_POUR_LENGTHS = 1.25
"""The same of a liquid, which rests at both ends, so that a longer path does no harm."""
_ROD_LENGTHS = 1.5
"""The same of rods, whose path is simulated as one."""

Clouds: TypeAlias = Float32[np.ndarray, "B N 3"]
Start: TypeAlias = tuple[np.ndarray, ...]
"""A simulator's own state at the beginning, by pushes."""


@final
@dataclass(frozen=True)
class Stepper:
    """The simulator of a subject in two parts, as many pushes begin alike.

    `begin` takes clouds (B, N, 3) [m] and those that were seen, if cameras are taken to err. `move` takes parameters
    phi (B, P), values of `ROD_NUMERICS` (B, U) or none, a start, labels (B, N, 4) and session times (B) as
    `sim.state.Setting` has them, paths of the tool (B, T, 3) [m] to the view on the way and from there, and how many
    time steps (B, 2) of each are needed, the last of the first and the first of the second; it returns the clouds then.
    """

    begin: Callable[[Clouds, Clouds], Start]
    move: Callable[..., tuple[jax.Array, jax.Array]]


def stepper(subject: Subject) -> Stepper:
    """The simulator of a subject, with all effects: to compile a few takes longer than all take in a whole study.

    Of a liquid with those that act on it, which are a quarter of them.
    """
    if subject.rods is not None:
        return _rod_stepper(subject.rods)
    effects = tuple(effect for effect in EFFECTS if subject.kind.name in effect.objects or not subject.kind.is_poured)
    kind, at_rest = subject.kind, subject.initial_state
    return _particle_stepper(subject.scene, subject.particle_count, at_rest, effects, may_spread=kind.is_poured)


def chunks(subject: Subject, platform: str) -> tuple[int, ...]:
    """Simulations at once; of particles as many as memory has grids for."""
    if subject.rods is not None:
        return _ROD_CHUNKS[platform]
    least, *larger = _CHUNKS[platform]
    most = _MOST_BYTES // (_NODE_BYTES * math.prod(subject.scene.shape))
    return least, *(size for size in larger if size <= most)


def length_ratio(subject: Subject, platform: str) -> float:
    """Ratio of one length of paths to the next longer one; 1: every number of blocks is a length."""
    if subject.rods is not None:
        return _ROD_LENGTHS
    if subject.kind.is_poured:
        return _POUR_LENGTHS
    return max(_LENGTHS[platform], _CARRY_LENGTHS) if subject.kind.is_in_space else _LENGTHS[platform]


def of_one_length(subject: Subject) -> bool:
    """True if paths of all pushes of a study are as long as the longest, of which rods make what they need."""
    return subject.rods is not None


@lru_cache(maxsize=16)
def _particle_stepper(
    scene: Scene, particles: int, at_rest: InitialState, effects: tuple[Effect, ...], *, may_spread: bool
) -> Stepper:
    """The simulator of particles; only what `may_spread` goes farther than the tool takes it."""
    simulate: Simulate = make_rollout(scene, particle_count=scene.split(particles), effects=effects)
    own = columns_of(effects)

    @jax.jit
    def block(phi: jax.Array, state: State, tool: jax.Array, label: jax.Array, time: jax.Array) -> State:
        return simulate(phi, state, tool, Setting(label=label, time=time))

    def moved(phi: np.ndarray, state: State, tool: np.ndarray, label: np.ndarray, time: np.ndarray) -> State:
        for first in range(0, tool.shape[1] - 1, BLOCK):
            state = block(phi, state, tool[:, first : first + BLOCK + 1], label, time)
        return state

    def stepped(
        phi: np.ndarray,
        _: np.ndarray,
        start: Start,
        label: np.ndarray,
        time: np.ndarray,
        first: np.ndarray,
        second: np.ndarray,
        _needed: np.ndarray,
    ) -> tuple[jax.Array, jax.Array]:
        phi = phi[:, own]
        began = at_rest(jnp.asarray(start[0]))
        stopped = moved(phi, began, first, label, time)
        end = moved(phi, stopped, second, label, time)
        if may_spread:
            return stopped.x, end.x
        return _unless_flung(began.x, stopped.x, end.x, jnp.concatenate([first, second], axis=1)[..., :3])

    return Stepper(begin=lambda x, _: (x,), move=stepped)


@lru_cache(maxsize=16)
def _rod_stepper(rods: RodModel) -> Stepper:
    scene, effects = rods.scene, tuple(effect for effect in EFFECTS if effect.rod is not None)
    simulate, own = make_rod_rollout(scene, effects), np.array(rod_columns(effects), int)
    at_rest = RodStart.of(scene)

    def begin(x: Clouds, seen: Clouds) -> Start:
        full = np.concatenate([np.arange(len(x)), np.full(-len(x) % _TRACED, len(x) - 1)])
        chunks = full.reshape(-1, _TRACED)
        parts = [at_rest.state_at(x[chunk], at_rest.places(seen[chunk])) for chunk in chunks]
        return tuple(
            np.concatenate([np.asarray(part[row]) for part in parts])[: len(x)] for row in range(len(parts[0]))
        )

    @jax.jit
    def stepped(
        phi: jax.Array,
        unknowns: jax.Array,
        start: tuple[jax.Array, ...],
        label: jax.Array,
        time: jax.Array,
        first: jax.Array,
        second: jax.Array,
        needed: jax.Array,
    ) -> tuple[jax.Array, jax.Array]:
        state, physics = RodState(*start), rod_physics(scene, contact_of(rods, unknowns), phi)
        along = material_coordinates(state.place, label[..., 0], scene.nodes)
        setting = RodSetting(material_coordinates=along, session_time=time)
        to_stop = jnp.full(len(needed), first.shape[1] - 1)
        late = jnp.stack([to_stop - needed[:, 0], to_stop], axis=1)
        early = needed * jnp.array([0, 1])
        stopped = simulate(physics, state, first, phi[:, own], setting, spans=late)
        end = simulate(physics, stopped, second, phi[:, own], setting, spans=early)
        return _unless_flung(state.x, stopped.x, end.x, jnp.concatenate([first, second], axis=1)[..., :2])

    return Stepper(begin=begin, move=stepped)


@jax.jit
def _unless_flung(
    start: Float[jax.Array, "B N 3"],
    stopped: Float[jax.Array, "B N 3"],
    end: Float[jax.Array, "B N 3"],
    tool: Float[jax.Array, "B T _"],
) -> tuple[Float[jax.Array, "B N 3"], Float[jax.Array, "B N 3"]]:
    """Clouds on the way and at the end; NaN of objects that were flung away, whose slopes would outweigh all others."""
    flung = is_flung(start, end, tool)[:, None, None]
    return jnp.where(flung, jnp.nan, stopped), jnp.where(flung, jnp.nan, end)


def is_flung(
    start: Float[jax.Array, "B N 3"], end: Float[jax.Array, "B N 3"], tool: Float[jax.Array, "B T _"]
) -> jax.Array:
    """True if a point of an object (B) went farther than a tool that pushes it can take it: its time steps failed.

    `tool`: its places [m], of two axes where it goes down and up without the object.
    """
    way = jnp.linalg.norm(jnp.diff(tool, axis=1), axis=2).sum(1)
    farthest = jnp.linalg.norm((end - start)[..., :2], axis=2).max(1)
    return ~(farthest < _LEVER * way + _SLID_M)


def contact_of(rods: RodModel, unknowns: Float[jax.Array, "B U"]) -> dict[str, float | jax.Array]:
    """Fields of `RodPhysics`, those of `ROD_NUMERICS` by so many steps from where they are nominally."""
    contact = dict(rods.contact)
    nominal = {**rods.scene.nominal_physics(), **contact}
    known: dict[str, float | jax.Array] = {**contact}
    for (_, unknown), steps in zip(rods.unknowns, unknowns.T, strict=True):
        here, apart = nominal[unknown.field], unknown.step * steps
        known[unknown.field] = here * jnp.exp(apart) if unknown.relative else here + apart
    known["viscosity"] = jnp.minimum(known["viscosity"], rods.scene.max_viscosity_n_m2_s)
    return known | {name: jnp.clip(known[name], 0.0, 1.0) for name in _SHARES}


def material_coordinates(
    place: Float[jax.Array, "B N"], label: Float[jax.Array, "B N"], nodes: int
) -> Float[jax.Array, "B n"]:
    """Material coordinates of a rod's nodes, from -1 at the object's first end to 1.

    `place`: of particles, in segments from the first node; `label`: their place along the object, from -1 to 1.
    """
    centred = place - place.mean(1, keepdims=True)
    direction = jnp.sign((centred * (label - label.mean(1, keepdims=True))).sum(1))
    return direction[:, None] * jnp.linspace(-1.0, 1.0, nodes)
