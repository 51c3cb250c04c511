"""How the arm moves along a path: straight lines, within speed and acceleration limits, and able to brake anywhere."""

from typing import final

import numpy as np
from jaxtyping import Float64

from app.config import Site
from app.core.messages import Motion
from app.core.types import Path3
from app.rig.simulated.physics import Position

_SAME_PLACE_M = 1e-6
_CORNER_TIME_S = 0.04
"""A corner is taken at the speed at which its change of velocity is what the acceleration limit gives in this time:
at 1.5 m/s^2 a jump of the command by at most 60 mm/s, which the drives round off."""


def route(start: Position, motion: Motion, site: Site) -> tuple[Path3, Float64[np.ndarray, " S"]]:
    """The whole path of `motion` from `start`, and the speed of each of its segments [m/s].

    Up to the travel height, across to above the first position, down, along the motion, and up again at its end.
    """
    first, last, travel = motion.positions[0], motion.positions[-1], site.travel_height_m
    raised = np.array([start[0], start[1], max(start[2], travel)])
    over = [np.array([place[0], place[1], max(place[2], travel)]) for place in (first, last)]
    points = np.stack([start, raised, over[0], *motion.positions, over[1]])
    fast = site.limits.speed_m_s
    speeds = np.concatenate([[fast, fast], motion.speeds, [fast]])
    kept = np.linalg.norm(np.diff(points, axis=0), axis=1) > _SAME_PLACE_M
    return points[np.concatenate([[True], kept])], speeds[kept]


@final
class PathFollower:
    """A point that runs along `points (P, 3)` and comes to rest at the last.

    It speeds up and slows down along the path by at most `acceleration_m_s2`, keeps to each segment's speed, and slows
    down before corners. Called `advance` by `advance`: whoever calls owns the clock.
    """

    def __init__(self, points: Path3, speeds: Float64[np.ndarray, " S"], acceleration_m_s2: float) -> None:
        steps = np.diff(points, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        self._points, self._speeds, self._acceleration = points, speeds, acceleration_m_s2
        self._at = np.concatenate([[0.0], np.cumsum(lengths)])
        self._node_speeds = _node_speeds(steps / lengths[:, None], lengths, speeds, acceleration_m_s2)
        self._length = float(self._at[-1])
        self._distance = self._speed = 0.0
        self._braking_m_s2 = 0.0

    @property
    def at_rest(self) -> bool:
        """Whether it has reached the end, or braked to a stop."""
        return self._distance >= self._length or (self._braking_m_s2 > 0 and self._speed == 0)

    def brake(self, deceleration_m_s2: float) -> None:
        """Come to rest on the path as soon as this deceleration allows, for good."""
        self._braking_m_s2 = deceleration_m_s2

    def advance(self, duration_s: float) -> Position:
        """Where it is `duration_s` later."""
        if self.at_rest:
            self._speed = 0.0
        elif self._braking_m_s2 > 0:
            self._speed = max(0.0, self._speed - self._braking_m_s2 * duration_s)
        else:
            self._speed = min(self._speed + self._acceleration * duration_s, self._allowed(duration_s))
        self._distance = min(self._distance + self._speed * duration_s, self._length)
        return np.array([np.interp(self._distance, self._at, self._points[:, axis]) for axis in range(3)])

    def _allowed(self, duration_s: float) -> float:
        """The fastest from which the next node's speed can still be met, one tick's travel included."""
        segment = min(int(np.searchsorted(self._at, self._distance, side="right")) - 1, len(self._speeds) - 1)
        room, half = self._at[segment + 1] - self._distance, self._acceleration * duration_s / 2
        braking = np.sqrt(self._node_speeds[segment + 1] ** 2 + 2 * self._acceleration * room + half**2) - half
        return float(min(self._speeds[segment], braking))


def _node_speeds(
    directions: Float64[np.ndarray, "S 3"],
    lengths: Float64[np.ndarray, " S"],
    speeds: Float64[np.ndarray, " S"],
    acceleration_m_s2: float,
) -> Float64[np.ndarray, " P"]:
    """The speed [m/s] at each point of the path: what corners allow, and from what the later ones can be met."""
    turn = np.linalg.norm(np.diff(directions, axis=0), axis=1)
    corner = acceleration_m_s2 * _CORNER_TIME_S / np.maximum(turn, 1e-9)
    inner = np.minimum(corner, np.minimum(speeds[:-1], speeds[1:]))
    nodes = np.concatenate([[0.0], inner, [0.0]])
    for index in range(len(lengths) - 1, -1, -1):
        reachable = np.sqrt(nodes[index + 1] ** 2 + 2 * acceleration_m_s2 * lengths[index])
        nodes[index] = min(nodes[index], reachable)
    return nodes
