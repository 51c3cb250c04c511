"""Rod state: a centreline of nodes, and the particles of the rope that go with it."""

from dataclasses import dataclass
from functools import lru_cache, partial
from typing import NamedTuple, Self, final

import jax
import jax.numpy as jnp
import numpy as np
from jax.core import Tracer
from jaxtyping import Float, Float32

from app.sim.rods.geometry.centreline import SMOOTHING, locate_particles, radius_of, trace
from app.sim.rods.geometry.rope_cloud import RopeShape
from app.sim.rods.scene import RodScene

STATE = 8
"""Rows of `RodState.nodes`."""

_ROUNDS = 6
"""Newton iterations towards segments of equal length; starts that are 2 mm off converge to 1e-6 in four."""


@final
class RodState(NamedTuple):
    """Ropes of B candidates as n nodes each, and N particles; a JAX pytree."""

    nodes: Float[jax.Array, "B 8 n"]
    """Rows: x, y [m], velocities [m/s], bristles of the table [m], that of the finger [m], bends about which
    yield is centred [rad]: of them a share lasts (`RodPhysics.permanent_set`)."""
    place: Float[jax.Array, "B N"]
    """Arc position of each particle, in segments from the first node."""
    offset: Float[jax.Array, "B N 3"]
    """Offset from the centreline there: forward, to the left, and above the table [m]."""

    @property
    def x(self) -> Float[jax.Array, "B N 3"]:
        """Positions of the particles [m]."""
        return _positions(self.nodes[:, :2], self.place, self.offset)

    @property
    def centreline(self) -> Float[jax.Array, "B 2 n"]:
        """Places [m] of the nodes."""
        return self.nodes[:, :2]

    @classmethod
    def at_rest(
        cls,
        x: Float[jax.Array, "B N 3"],
        count: int,
        rest_m: float,
        radius_m: float | None = None,
        near: Float[jax.Array, "2 n"] | None = None,
    ) -> Self:
        """Unmoving, its bends at the centre of yield: `count` nodes, `rest_m` apart, through particles `x` of a rope.

        The order along the rope is found on the host (`centreline.trace`), from the prediction `near` [m] too where
        there is one. Nodes minimise squared distances of particles to their places on the polygon, weighted by how near
        to the centreline they must be, plus squared second differences, and are then moved to the nearest polygon whose
        segments are all `rest_m` long: linear in `x` but for that. `radius_m`: None, as evenly filled as `x` is high.
        """
        prior = np.zeros((2, 0), np.float32) if near is None else near
        if not isinstance(x, Tracer):  # A program that asks the host is kept on no disk.
            labels = _labels(count, rest_m, radius_m, x, prior)
            return cls(*_through(jnp.asarray(x, jnp.float32), jnp.asarray(labels), count, rest_m))
        return cls(*_at_rest(jnp.asarray(x, jnp.float32), count, rest_m, radius_m, jnp.asarray(prior, jnp.float32)))

    @classmethod
    def along(cls, line: Float[jax.Array, "B 2 n"]) -> Self:
        """Unmoving, its bends at the centre of yield, through known nodes on the table, which are its particles."""
        line = jnp.asarray(line, jnp.float32)
        place = jnp.tile(jnp.arange(line.shape[2], dtype=jnp.float32), (len(line), 1))
        return cls(nodes=_unmoving(line), place=place, offset=jnp.zeros((*place.shape, 3)))

    def resting(self) -> Self:
        """The same without motion; what friction and yield have stored stays."""
        return self._replace(nodes=self.nodes.at[:, 2:4].set(0.0))


@partial(jax.jit, static_argnums=(1, 2, 3))
def _at_rest(
    x: Float[jax.Array, "B N 3"], count: int, rest_m: float, radius_m: float | None, near: Float[jax.Array, "2 k"]
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """Nodes, places and offsets of `RodState`."""
    shape = jax.ShapeDtypeStruct((2, *x.shape[:2]), jnp.float32)
    labels = partial(_labels, count, rest_m, radius_m)
    known = jax.pure_callback(labels, shape, *jax.lax.stop_gradient((x, near)))
    return _through(x, jax.lax.stop_gradient(known), count, rest_m)


@partial(jax.jit, static_argnums=(2, 3))
def _through(
    x: Float[jax.Array, "B N 3"], labels: Float[jax.Array, "2 B N"], count: int, rest_m: float
) -> tuple[jax.Array, jax.Array, jax.Array]:
    """The same of particles whose places along the rope, and weights, are known."""
    place, weight = labels
    line = inextensible(jax.vmap(_centreline, (0, 0, 0, None))(x[..., :2], place, weight, count), rest_m)
    return _unmoving(line), place, _offsets(x, line, place)


def _unmoving(line: Float[jax.Array, "B 2 n"]) -> Float[jax.Array, "B 8 n"]:
    """The rows `nodes` of unmoving ropes at the centre of yield."""
    candidates, _, count = line.shape
    return jnp.zeros((candidates, STATE, count)).at[:, :2].set(line).at[:, 7, 1:-1].set(bends(line))


@final
@dataclass(frozen=True)
class RodStart:
    """`RodState.at_rest` for one scene; hashable by its numbers, so that compiled code is found again."""

    count: int
    rest_m: float
    radius_m: float | None = None

    @classmethod
    def of(cls, scene: RodScene) -> Self:
        """Start of the rope of a scene."""
        return cls(scene.nodes, scene.rest_m, scene.radius_m)

    @property
    def shape(self) -> RopeShape:
        """The rope as it is known."""
        assert self.radius_m is not None
        return RopeShape(count=self.count, rest_m=self.rest_m, radius_m=self.radius_m)

    def __call__(self, x: Float[jax.Array, "B N 3"], near: Float[jax.Array, "2 n"] | None = None) -> RodState:
        """Unmoving, its bends at the centre of yield."""
        return RodState.at_rest(x, self.count, self.rest_m, self.radius_m, near)

    def places(self, x: Float32[np.ndarray, "B N 3"]) -> Float32[np.ndarray, "2 B N"]:
        """Arc positions of particles on their ropes, in segments, and their weights: 1 in the mean."""
        return _labels(self.count, self.rest_m, self.radius_m, x, np.zeros((2, 0), np.float32))

    def state_at(self, x: Float32[np.ndarray, "B N 3"], places: Float32[np.ndarray, "2 B N"]) -> RodState:
        """State through particles that were moved a little since their `places` were found."""
        return RodState(*_through(jnp.asarray(x), jnp.asarray(places), self.count, self.rest_m))


@jax.jit  # Asked for again and again where a plan is traced.
def _positions(
    line: Float[jax.Array, "B 2 n"], place: Float[jax.Array, "B N"], offset: Float[jax.Array, "B N 3"]
) -> Float[jax.Array, "B N 3"]:
    """Positions of particles at `place` on polygons, `offset` from there [m]."""
    middle, tangent = frames(line, place)
    along, left, height = jnp.moveaxis(offset, -1, 0)
    x = middle[..., 0] + along * tangent[..., 0] - left * tangent[..., 1]
    y = middle[..., 1] + along * tangent[..., 1] + left * tangent[..., 0]
    return jnp.stack([x, y, height], axis=-1)


def frames(
    line: Float[jax.Array, "B 2 n"], place: Float[jax.Array, "B N"]
) -> tuple[Float[jax.Array, "B N 2"], Float[jax.Array, "B N 2"]]:
    """Points of polygons at `place`, and unit tangents there, which turn evenly from node to node."""
    edges = jnp.diff(line, axis=2)
    edges /= jnp.linalg.norm(edges, axis=1, keepdims=True)
    turning = jnp.concatenate([edges[..., :1], edges[..., 1:] + edges[..., :-1], edges[..., -1:]], axis=2)
    turning /= jnp.linalg.norm(turning, axis=1, keepdims=True) + 1e-9
    first, share = _segments(place, line.shape[2])

    def between(values: jax.Array) -> jax.Array:
        at = jnp.broadcast_to(first[:, None], (len(first), 2, first.shape[1]))
        one, other = jnp.take_along_axis(values, at, 2), jnp.take_along_axis(values, at + 1, 2)
        return one + share[:, None] * (other - one)

    tangent = between(turning)
    tangent /= jnp.linalg.norm(tangent, axis=1, keepdims=True) + 1e-9
    return jnp.moveaxis(between(line), 1, 2), jnp.moveaxis(tangent, 1, 2)


@jax.jit
def bends(line: Float[jax.Array, "B 2 n"]) -> Float[jax.Array, "B n-2"]:
    """Angles [rad] between neighbouring segments, positive to the left, as rod.h has them; it bends no further back."""
    edges = jnp.diff(line, axis=2)
    one, other = edges[..., :-1], edges[..., 1:]
    cross = one[:, 0] * other[:, 1] - one[:, 1] * other[:, 0]
    size = jnp.linalg.norm(one, axis=1) * jnp.linalg.norm(other, axis=1)
    u = 2 * cross / jnp.maximum(size + (one * other).sum(1), 0.1 * size)
    return u * (1 - u**2 * (1 / 12 - u**2 / 80))


def inextensible(line: Float[jax.Array, "B 2 n"], rest_m: float) -> Float[jax.Array, "B 2 n"]:
    """The nearest polygons, to first order, whose segments are all `rest_m` long: a rod must not start strained."""
    count = line.shape[2] - 1
    at = jnp.arange(count)

    def closer(_: jax.Array, x: jax.Array) -> jax.Array:
        edges = jnp.diff(x, axis=2)
        length = jnp.linalg.norm(edges, axis=1)
        t = edges / length[:, None]
        beside = -(t[..., 1:] * t[..., :-1]).sum(1)
        matrix = jnp.zeros((len(x), count, count)).at[:, at, at].set(2.0)
        matrix = matrix.at[:, at[1:], at[:-1]].set(beside).at[:, at[:-1], at[1:]].set(beside)
        push = jnp.linalg.solve(matrix, (rest_m - length)[..., None])[..., 0][:, None] * t
        return x.at[..., 1:].add(push).at[..., :-1].add(-push)

    return jax.lax.fori_loop(0, _ROUNDS, closer, line)


def _segments(place: jax.Array, count: int) -> tuple[jax.Array, jax.Array]:
    """The segment of `count` nodes in which each place is, and where in it, from 0 to 1."""
    first = jnp.clip(jnp.floor(place), 0, count - 2).astype(jnp.int32)
    return first, place - first


def _centreline(
    x: Float[jax.Array, "N 2"], place: Float[jax.Array, " N"], weight: Float[jax.Array, " N"], count: int
) -> Float[jax.Array, "2 n"]:
    first, share = _segments(place, count)
    rows = jnp.arange(len(x))
    parts = jnp.zeros((len(x), count)).at[rows, first].set(1 - share).at[rows, first + 1].set(share)
    second = np.diff(np.eye(count, dtype=np.float32), 2, axis=0)
    turned = parts.T * weight
    squares = turned @ parts + SMOOTHING * len(x) / count * second.T @ second
    return jnp.linalg.solve(squares, turned @ x).T


def _offsets(
    x: Float[jax.Array, "B N 3"], line: Float[jax.Array, "B 2 n"], place: Float[jax.Array, "B N"]
) -> Float[jax.Array, "B N 3"]:
    middle, t = frames(line, place)
    d = x[..., :2] - middle
    along = (d * t).sum(-1)
    left = d[..., 1] * t[..., 0] - d[..., 0] * t[..., 1]
    return jnp.stack([along, left, x[..., 2]], axis=-1)


def _labels(
    count: int, rest_m: float, radius_m: float | None, x: jax.Array | np.ndarray, near: jax.Array | np.ndarray
) -> Float32[np.ndarray, "2 B N"]:
    """Places along the rope, and weights, one in the mean."""
    prior = np.asarray(near, np.float32).tobytes()
    # A JAX array that is walked through here waits for a thread that waits for this function.
    clouds = [cloud.tobytes() for cloud in np.asarray(x, np.float32)]
    return np.stack([_label(cloud, count, rest_m, radius_m, prior) for cloud in clouds], axis=1)


_KEPT = 4096
"""Clouds whose places are remembered: more than a calibration's transitions, each of which is asked for at every step
of a fit. With fewer, in the same order, none is found again. 25 MB of 300 particles each."""


@lru_cache(maxsize=_KEPT)
def _label(cloud: bytes, count: int, rest_m: float, radius_m: float | None, near: bytes) -> Float32[np.ndarray, "2 N"]:
    """Places and weights of one cloud, for which planners ask as often as they have candidates."""
    x = np.frombuffer(cloud, np.float32).reshape(-1, 3)
    prior = np.frombuffer(near, np.float32).reshape(2, -1).T.astype(np.float64)
    if not np.isfinite(x).all():
        return np.ones((2, len(x)), np.float32)
    rope = RopeShape(count=count, rest_m=rest_m, radius_m=radius_m or radius_of(x, rest_m))
    return np.stack(locate_particles(x, trace(x, rope, prior if len(prior) else None).line, rope))
