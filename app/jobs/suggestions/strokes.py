"""A suggested push or sweep as a motion, aimed at the object's present position."""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING

import numpy as np

from app.config import Site
from app.core.errors import PlanningError
from app.core.geometry.finger_distance import nearest_m
from app.core.motion import Motion
from app.policy.random_pushes import Stroke
from app.policy.random_sweeps import clearance_m

if TYPE_CHECKING:
    from jaxtyping import Float64, Int

    from app.core.geometry.track import Track
    from app.core.types import Points
    from app.planner.actions.actions import Pushes
    from app.planner.actions.sweep_actions import Sweeps

_WAYPOINTS = 20
_SLOWEST_M_S = 1e-3
_THROUGH_M = 0.006
"""A way that comes this near to a particle goes through the object, and does not graze it."""
_AHEAD_M = 0.034
"""Distance of a start before a particle, as in random pushes (`app.policy.random_pushes`)."""
_STILL_M, _LOW_M = 1e-5, 1e-3
"""A tool that moves less than this between two moments stands; one that is this far above its lowest is down."""


def stroke_along(track: Track, actions: Pushes | Sweeps, site: Site) -> Motion:
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
