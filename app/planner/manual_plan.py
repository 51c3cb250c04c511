"""A push drawn by an operator, evaluated as a branch of the tree: simulated, continued by the policy, and costed."""

from dataclasses import dataclass, replace
from typing import final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Float32

from app.config import Site
from app.core.errors import PlanningError
from app.core.geometry.finger_distance import nearest_m
from app.core.messages import Origin
from app.core.types import Path3, Points
from app.planner.actions.actions import Pushes
from app.planner.search.optimise import OptimizedRollouts
from app.planner.search.plan import Plan, choose
from app.planner.search.request import PlanRequest
from app.planner.search.rollout_frames import grow
from app.planner.search.tree import RootBatch, TreeConfig, situation, start_by_policy

_SHORTEST_M = 0.005
_MENDED_M = 5e-4
"""Largest correction by projection; an action that it changes by more is not the requested one."""
_CM, _MM = 1e2, 1e3


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class GivenPush:
    """A `Planner` that plans this alone: the push along `way` (W, 3) [m], and what the policy does after it.

    `search`: of one branch; `pushes`: its action space.
    """

    search: TreeConfig
    pushes: Pushes
    way: Path3

    def __call__(self, request: PlanRequest) -> Plan:
        """Plan of one branch. Raises PlanningError with the defect of the push, in words."""
        wanted = action_of(self.way, self.pushes)
        require(wanted, request.observed, self.pushes, request.site)
        now = situation(self.search, request)
        prepared, _ = start_by_policy(self.search, request.observed, request.goal, now)
        later = jnp.zeros((1, self.search.depth - 1, self.search.space.size))
        given = jnp.zeros(later.shape[:2], bool)
        tree = RootBatch(
            prepared=prepared,
            phi=jnp.asarray(request.phi)[None],
            now=now,
            first=jnp.asarray(wanted)[None],
            later=later,
            given=given,
            shares=jnp.ones(1),
        )
        grown = grow(self.search, tree, jnp.asarray(request.goal))
        _require_unmended(wanted, np.asarray(grown.rollout.actions[0, 0]))
        origins: list[Origin] = ["edited"]
        found = jax.device_get(OptimizedRollouts.from_samples(grown.rollout, grown.rollout.cost[None]))
        return choose(self.search, found, origins, replace(request, rejected=()), seen=grown.moments)

    def compile(self, example: Points, phi: Float32[np.ndarray, " P"]) -> None:
        """Do nothing in advance: few are drawn, and each takes a second."""


def action_of(way: Path3, pushes: Pushes) -> Float32[np.ndarray, " A"]:
    """The push along a way over the table, in displacements of equal length."""
    arc = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(way[:, :2], axis=0), axis=1))])
    nodes = np.linspace(0.0, arc[-1], pushes.displacements + 1)
    points = np.stack([np.interp(nodes, arc, way[:, axis]) for axis in range(2)], axis=1)
    return np.concatenate([points[0], np.diff(points, axis=0).ravel()]).astype(np.float32)


def require(action: Float32[np.ndarray, " A"], x: Points, pushes: Pushes, site: Site) -> None:
    """Raises PlanningError where a push on the object `x` (N, 3) [m] cannot be made, with what has to change."""
    if not np.isfinite(action).all():
        raise PlanningError("Its ends are no places; put the handles on the table.")
    points = np.cumsum(np.concatenate([action[None, :2], action[2:].reshape(-1, 2)]), axis=0)
    length_m = float(np.linalg.norm(np.diff(points, axis=0), axis=1).sum())
    if length_m < _SHORTEST_M:
        raise PlanningError(f"It is {length_m * _MM:.0f} mm long, which moves nothing; pull its ends apart.")
    if length_m > pushes.max_length_m + _MENDED_M:
        longest = f"the longest push of this task is {pushes.max_length_m * _CM:.0f} cm"
        raise PlanningError(f"It is {length_m * _CM:.1f} cm long, and {longest}; bring its ends closer together.")
    low, high = np.array(pushes.region[:2]), np.array(pushes.region[2:])
    inside = bool(((points > low - _MENDED_M) & (points < high + _MENDED_M)).all())
    limits = site.limits.workspace
    flat = np.column_stack([points, np.full(len(points), pushes.height_m)])
    if not (inside and limits.contains(flat)):
        (x0, y0), (x1, y1) = np.maximum(low, limits.low[:2]), np.minimum(high, limits.high[:2])
        within = f"x {x0:.2f} to {x1:.2f} m, y {y0:.2f} to {y1:.2f} m"
        raise PlanningError(f"It leaves the region of pushes ({within}); move its ends inside.")
    near_m = float(nearest_m(points[:1], x[:, :2], pushes.core_m)[0])
    if near_m < pushes.clearance_m - _MENDED_M:
        beside = f"the finger comes down {pushes.clearance_m * _MM:.0f} mm beside it or more"
        raise PlanningError(f"It begins {near_m * _MM:.0f} mm from the object, and {beside}; move its start away.")


def _require_unmended(wanted: Float32[np.ndarray, " A"], made: Float32[np.ndarray, " A"]) -> None:
    ways = [np.cumsum(action.reshape(-1, 2), axis=0) for action in (wanted, made)]
    if not np.abs(ways[0] - ways[1]).max() < _MENDED_M:
        raise PlanningError("It goes where something stands in the finger's way; lead it past that.")
