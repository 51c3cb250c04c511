"""The scripted initial policy: push the rope from behind, where most of it has furthest to go the same way."""

from dataclasses import dataclass
from functools import lru_cache
from typing import NamedTuple, final

import jax.numpy as jnp
import numpy as np
from jax.lax import Precision
from jaxtyping import Array, Float, Float32

from app.core.geometry.finger_distance import extent_m, from_core
from app.core.types import Points
from app.policy.base import ActionDistribution, PlanningState
from app.sim.rods.geometry.arc_length import arclength_labels, centreline_weights

_BLOCKED_M = 10.0
"""Penalty above any sum of errors on a table: a start on top of the rope is chosen only if there is no other."""

_UNDIRECTED_M = 1e-3
"""An error below this is noise, and its direction tells nothing: the push is then straight across the rope."""


@lru_cache(maxsize=4)
def _line(cloud: bytes, nodes: int) -> Float32[np.ndarray, "M 2"]:
    """Nodes of a goal's centreline [m], for which every decision on the way to it asks."""
    x = np.frombuffer(cloud, np.float32).reshape(-1, 3)
    return (centreline_weights(arclength_labels(x), nodes) @ x)[:, :2]


class Matched(NamedTuple):
    """Prepared once per observation: weights that average particles into nodes, and the goal's nodes both ways."""

    weights: Float32[np.ndarray, "M N"]
    goals: Float32[np.ndarray, "2 M 2"]


@final
@dataclass(frozen=True, kw_only=True)
class ScriptedPush:
    """Push chosen from the error of each node of the rope's centreline: its place along the rope, direction and length.

    A push at one node carries its neighbours along, over about `reach` of the length. It works best across the rope,
    so the direction is that of the error but at most `max_tilt_rad` from the normal. The finger starts `start_gap_m`
    behind the centreline and ends `contact_gap_m` behind where the node shall be; the push is at most `max_length_m`.
    Returns actions of `displacements` equal displacements (see `app.planner.actions.actions.Pushes`).
    """

    start_gap_m: float
    contact_gap_m: float
    max_length_m: float
    clearance_m: float
    core_m: tuple[float, float] = (0.0, 0.0)
    """Core of a flat finger (`Finger.half_m`), which starts and ends farther behind as far as it reaches ahead."""
    reach: float = 0.15
    max_tilt_rad: float = 0.9
    nodes: int = 24
    displacements: int = 20

    def prepare(self, observed: Points, goal: Points) -> Matched:
        """Order both clouds along the rope; the goal is kept in both directions, for the cheaper one to be chosen."""
        weights = centreline_weights(arclength_labels(observed), self.nodes)
        line = _line(np.asarray(goal, np.float32).tobytes(), self.nodes)
        return Matched(weights, np.stack([line, line[::-1]]))

    def act(self, prepared: Matched, now: PlanningState) -> ActionDistribution:
        """The push that helps most, for each candidate."""
        x = now.x
        nodes = jnp.einsum("mn,bnk->bmk", prepared.weights, x[..., :2], precision=Precision.HIGHEST)
        error = _nearer_goal(jnp.asarray(prepared.goals), nodes) - nodes
        direction = self._directions(nodes, error)
        share = self._shares()
        advance = jnp.einsum("mj,bjk,bmk->bm", share, error, direction, precision=Precision.HIGHEST)
        start = nodes - (self.start_gap_m + extent_m(direction, self.core_m))[..., None] * direction
        near = jnp.sqrt((from_core(start[:, :, None] - x[:, None, :, :2], self.core_m) ** 2).sum(-1)).min(-1)
        gain = advance * share.sum(1) - jnp.where(near < self.clearance_m, _BLOCKED_M, 0.0)
        best = jnp.argmax(gain, axis=1)[:, None]
        advance = jnp.take_along_axis(advance / share.sum(1), best, axis=1)
        start, direction = (jnp.take_along_axis(a, best[..., None], axis=1)[:, 0] for a in (start, direction))
        length = jnp.clip(advance + self.start_gap_m - self.contact_gap_m, 0.0, self.max_length_m)
        steps = jnp.tile(length * direction / self.displacements, (1, self.displacements))
        return ActionDistribution.surely(jnp.concatenate([start, steps], axis=1))

    def _directions(self, nodes: Float[Array, "B M 2"], error: Float[Array, "B M 2"]) -> Float[Array, "B M 2"]:
        """Unit vectors along the errors, turned towards the normal of the rope where they lean too far."""
        tangent = _unit(jnp.asarray(jnp.gradient(nodes, axis=1)))
        normal = jnp.stack([-tangent[..., 1], tangent[..., 0]], axis=-1)
        along, across = (error * tangent).sum(-1), (error * normal).sum(-1)
        side = jnp.where(across < 0, -1.0, 1.0)
        tilt = jnp.arctan2(along, jnp.abs(across) + _UNDIRECTED_M)
        tilt = jnp.clip(tilt, -self.max_tilt_rad, self.max_tilt_rad)[..., None]
        return jnp.cos(tilt) * side[..., None] * normal + jnp.sin(tilt) * tangent

    def _shares(self) -> Float32[np.ndarray, "M M"]:
        """Influence of a push at node m on each node j, a Gaussian of their distance."""
        at = np.arange(self.nodes) / self.nodes
        return np.exp(-0.5 * ((at[:, None] - at) / self.reach) ** 2).astype(np.float32)


def _nearer_goal(goals: Float[Array, "2 M 2"], nodes: Float[Array, "B M 2"]) -> Float[Array, "B M 2"]:
    squared = ((goals[None] - nodes[:, None]) ** 2).sum((-1, -2))
    return goals[jnp.argmin(squared, axis=1)]


def _unit(vectors: Float[Array, "*axes 2"]) -> Float[Array, "*axes 2"]:
    return vectors / jnp.sqrt((vectors**2).sum(-1, keepdims=True) + 1e-12)
