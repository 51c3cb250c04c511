"""A suggested push or sweep as a plan: aimed at the object's present position, and simulated as any other."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from app.config import Site
from app.core.errors import PlanningError, UsageError
from app.core.geometry.chamfer import chamfer_m2
from app.core.geometry.finger_distance import nearest_m
from app.core.geometry.orientation import UNKNOWN, Orientation
from app.core.messages import Branch
from app.core.motion import Motion
from app.policy.random_pushes import Stroke
from app.policy.random_sweeps import clearance_m

if TYPE_CHECKING:
    from jaxtyping import Float64, Int

    from app.core.geometry.track import Track
    from app.core.messages import Model
    from app.core.types import Centreline, Points
    from app.planner.actions.actions import Pushes
    from app.planner.actions.sweep_actions import Sweeps
    from app.planner.search.plan import Plan

_WAYPOINTS = 20
_SLOWEST_M_S = 1e-3
_THROUGH_M = 0.006
"""A way that comes this near to a particle goes through the object, and does not graze it."""
_AHEAD_M = 0.034
"""Distance of a start before a particle, as in random pushes (`app.policy.random_pushes`)."""
_STILL_M, _LOW_M = 1e-5, 1e-3
"""A tool that moves less than this between two moments stands; one that is this far above its lowest is down."""


def motion_of(track: Track, actions: Pushes | Sweeps, site: Site) -> Motion:
    """A recorded way of the tool as a motion: down, the way itself at its own speed, and up.

    A finger is not turned, a paddle is across its way, which is straight. No faster and no higher than the site allows.
    """
    from app.planner.actions.sweep_actions import Sweeps
    from app.policy.base import PARKED_POSE

    low = _down(track.positions)
    way, times = track.positions[low], track.times_s[low]
    steps = np.concatenate([[0.0], np.linalg.norm(np.diff(way[:, :2], axis=0), axis=1)])
    arc = np.cumsum(steps)
    moving = np.flatnonzero(steps > _STILL_M)
    lasts_s = float(times[moving[-1]] - times[moving[0] - 1]) if len(moving) else 1.0
    speed = max(float(arc[-1]) / lasts_s, _SLOWEST_M_S)
    if isinstance(actions, Sweeps):
        swept = actions.motion(way[[0, -1], :2].ravel().astype(np.float32), PARKED_POSE, site)
        speeds = np.where(np.arange(len(swept.speeds)) == len(swept.speeds) - 2, speed, swept.speeds)
        return replace(swept, speeds=np.minimum(speeds, site.limits.speed_m_s))
    nodes = np.linspace(0.0, arc[-1], _WAYPOINTS + 1)
    push = np.stack([np.interp(nodes, arc, way[:, axis]) for axis in range(3)], axis=1)
    push[:, 2] = np.maximum(push[:, 2], site.limits.workspace.low[2])
    above = push[[0, -1]]
    above[:, 2] = site.travel_height_m
    positions = np.concatenate([above[:1], push, above[1:]])
    speeds = np.full(len(positions), speed)
    speeds[[0, 1, -1]] = actions.approach_m_s
    return Motion(positions=positions, speeds=np.minimum(speeds, site.limits.speed_m_s))


def plan_of_suggestion(
    task: str,
    observed: Points,
    goal: Points,
    model: Model,
    asked: Motion,
    site: Site | None = None,
    near: Centreline | None = None,
    orientation: Orientation = UNKNOWN,
) -> Plan:
    """`asked` as a plan of one branch for the object that the cameras say is at `observed` (N, 3) [m].

    The push keeps its direction, length and speed, and is moved to where the object is. What the model says of cameras
    and arm is allowed for, and `near` and `orientation` are used, as in `jobs.plan`. Raises PlanningError where the
    push fits nowhere.
    """
    import jax
    import jax.numpy as jnp

    from app.jobs import jit_cache, rope_orientation
    from app.jobs.apparatus_compensation import correction
    from app.planner.actions.actions import Pushes
    from app.planner.actions.sweep_actions import Sweeps
    from app.planner.search.plan import Plan
    from app.tasks import load

    data, where = load(task), site or Site()
    if not isinstance(data.actions, Pushes | Sweeps):
        raise UsageError(f"A push or a sweep is suggested, and {task} has none.")
    allowed_for = correction(model) if model.apparatus else None
    x = allowed_for.unproject(observed) if allowed_for else observed
    made = aim_at(asked, x, data.actions, where)
    path = data.actions.measured_path(made.positions)
    simulate = jax.jit(jit_cache.action_simulator(task, len(x), *jit_cache.needs(task, jit_cache.phi_of(model))))
    before = data.initial_state(jnp.asarray(x)[None], None if near is None else jnp.asarray(near))
    phi = rope_orientation.oriented_phi(model, x, orientation, near)
    end = simulate(jnp.asarray(phi)[None], before, jnp.asarray(path)[None])
    predicted = np.asarray(end.x[0])
    if not np.isfinite(predicted).all():
        raise PlanningError("its simulation became non-finite; planning as usual.")
    motion = allowed_for.command(made, x, predicted, where) if allowed_for else made
    if not where.limits.workspace.contains(motion.positions):
        raise PlanningError("what the arm would have to be told leaves the workspace; planning as usual.")
    shown = allowed_for.observe(predicted) if allowed_for else predicted
    branch = Branch(
        origin="asked",
        actions=path[None, :, :2].reshape(1, -1),
        tool_path=path[:, :3],
        predicted=shown,
        final=shown,
        cost_before=float("nan"),
        cost_after=float("nan"),
        terms={},
        finite=True,
    )
    return Plan(
        branches=(branch,),
        best=0,
        motion=motion,
        predicted=shown,
        centreline=np.asarray(end.centreline[0]),
        chamfer_m2=float(chamfer_m2(x, goal)),
        predicted_chamfer_m2=float(chamfer_m2(predicted, goal)),
    )


def aim_at(asked: Motion, x: Points, actions: Pushes | Sweeps, site: Site) -> Motion:
    """The motion moved over the table by as little as makes it begin beside the object and meet it.

    Raises PlanningError where there is no such place within the region of pushes.
    """
    way, object_ = asked.positions[_down(asked.positions), :2], x[:, :2].astype(np.float64)
    ahead = (way[-1] - way[0]) / max(float(np.linalg.norm(way[-1] - way[0])), 1e-9)
    shifts = np.concatenate([np.zeros((1, 2)), object_ - (way[0] + _AHEAD_M * ahead)])
    for shift in shifts[np.argsort(np.linalg.norm(shifts, axis=1), kind="stable")]:
        if _fits(way + shift, x, actions):
            moved = asked.positions + np.array([shift[0], shift[1], 0.0])
            if site.limits.workspace.contains(moved):
                return replace(asked, positions=moved)
    raise PlanningError(
        "wherever it begins beside the object it leaves the region of pushes or the workspace; move the object towards "
        "the middle of the table and start again, or go on with plans as usual."
    )


def _down(positions: Float64[np.ndarray, "T 3"]) -> Int[np.ndarray, " L"]:
    """Indices at which the tool is down."""
    return np.flatnonzero(positions[:, 2] < positions[:, 2].min() + _LOW_M)


def _fits(way: Float64[np.ndarray, "W 2"], x: Points, actions: Pushes | Sweeps) -> bool:
    """True if it begins beside the object and meets it in the first half of its path, all within the region."""
    from app.planner.actions.sweep_actions import Sweeps

    low, high, object_ = np.array(actions.region[:2]), np.array(actions.region[2:]), x[:, :2].astype(np.float64)
    if ((way < low) | (way > high)).any():
        return False
    if isinstance(actions, Sweeps):
        length_m = float(np.linalg.norm(way[-1] - way[0]))
        ahead = (way[-1] - way[0]) / max(length_m, 1e-9)
        stroke = Stroke(start=way[0], ahead=ahead, length_m=length_m, speed_m_s=actions.speed_m_s)
        along, across = (object_ - way[0]) @ ahead, np.abs((object_ - way[0]) @ np.array([-ahead[1], ahead[0]]))
        met = (along > 0) & (along < length_m / 2) & (across < actions.half_m[0])
        return clearance_m(stroke, x, actions.half_m) >= actions.clearance_m and bool(met.any())
    near = nearest_m(way, object_, actions.core_m)
    return bool(near[0] >= actions.clearance_m and near[: len(way) // 2 + 1].min() < _THROUGH_M)
