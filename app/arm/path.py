"""Path following: straight lines, within speed and acceleration limits, with a stop possible anywhere.

A path runs through coordinates in which every part of a tool's pose is a length: a rotation counts as the path of a
point `_LEVER_M` from the tip, an opening as it is. So one speed limits translation, rotation and opening.
"""

from typing import Final, final

import numpy as np
from jaxtyping import Float64

from app.config import Site
from app.core.motion import Motion
from app.core.types import ToolPath, ToolPose

_SAME_PLACE_M = 1e-6
_LEVER_M = 0.1
"""Lever of rotations, about the size of held objects. A unit quaternion moves by half the rotation angle."""
SCALE: Final = np.array([1.0] * 3 + [2 * _LEVER_M] * 4 + [1.0])
_CORNER_TIME_S = 0.04
"""Time in which the acceleration limit gives a corner's change of velocity: at 1.5 m/s^2 a step of the command by at
most 60 mm/s, which the drives round off."""


def route(start: ToolPose, motion: Motion, site: Site) -> tuple[ToolPath, Float64[np.ndarray, " S"]]:
    """The whole path of `motion` from `start`, and the speed of each of its segments [m/s].

    Up to the travel height, across to above the first position, down, along the motion, and up again at its end; a
    motion that continues has only the path from `start` along it.
    """
    way, fast = motion.poses, site.limits.speed_m_s
    if motion.continues:
        points, speeds = np.stack([start, *way]), motion.speeds
    else:
        points = np.stack(
            [
                start,
                at_travel_height(start, site),
                at_travel_height(way[0], site),
                *way,
                at_travel_height(way[-1], site),
            ]
        )
        speeds = np.concatenate([[fast, fast], motion.speeds, [fast]])
    points = _same_sided(points)
    kept = np.linalg.norm(np.diff(points * SCALE, axis=0), axis=1) > _SAME_PLACE_M
    return points[np.concatenate([[True], kept])], speeds[kept]


def at_travel_height(pose: ToolPose, site: Site) -> ToolPose:
    """The pose at the travel height, or at its own height where that is higher."""
    raised = pose.copy()
    raised[2] = max(pose[2], site.travel_height_m)
    return raised


def _same_sided(poses: ToolPath) -> ToolPath:
    """The poses with each quaternion's sign nearest to the one before."""
    turns = poses[:, 3:7]
    flips = np.where((turns[1:] * turns[:-1]).sum(1) < 0, -1.0, 1.0)
    return np.concatenate([poses[:, :3], turns * np.cumprod([1.0, *flips])[:, None], poses[:, 7:]], axis=1)


def normalize(pose: ToolPose) -> ToolPose:
    """The pose with its quaternion normalised, as an interpolated one is not of unit length."""
    turn = pose[3:7]
    return np.array([*pose[:3], *(turn / np.linalg.norm(turn)), pose[7]])


@final
class PathFollower:
    """Follower of the poses `points (P, 8)`, which comes to rest at the last.

    It accelerates and decelerates along the path by at most `acceleration_m_s2`, keeps each segment's speed, and slows
    down before corners. The caller of `advance` owns the clock.
    """

    def __init__(self, points: ToolPath, speeds: Float64[np.ndarray, " S"], acceleration_m_s2: float) -> None:
        steps = np.diff(points * SCALE, axis=0)
        lengths = np.linalg.norm(steps, axis=1)
        self._points, self._speeds, self._acceleration = points, speeds, acceleration_m_s2
        self._at = np.concatenate([[0.0], np.cumsum(lengths)])
        self._node_speeds = _node_speeds(steps / lengths[:, None], lengths, speeds, acceleration_m_s2)
        self._length = float(self._at[-1])
        self._distance = self._speed = 0.0
        self._braking_m_s2 = 0.0

    @property
    def at_rest(self) -> bool:
        """True once it has reached the end, or braked to a stop."""
        return self._distance >= self._length or (self._braking_m_s2 > 0 and self._speed == 0)

    def brake(self, deceleration_m_s2: float) -> None:
        """Come to rest on the path as soon as this deceleration allows, for good."""
        self._braking_m_s2 = deceleration_m_s2

    def advance(self, duration_s: float) -> ToolPose:
        """Pose `duration_s` later."""
        if self.at_rest:
            self._speed = 0.0
        elif self._braking_m_s2 > 0:
            self._speed = max(0.0, self._speed - self._braking_m_s2 * duration_s)
        else:
            self._speed = min(self._speed + self._acceleration * duration_s, self._speed_limit(duration_s))
        self._distance = min(self._distance + self._speed * duration_s, self._length)
        return normalize(np.array([np.interp(self._distance, self._at, column) for column in self._points.T]))

    def _speed_limit(self, duration_s: float) -> float:
        """Highest speed from which the next node's speed can still be met, one tick's travel included."""
        segment = min(int(np.searchsorted(self._at, self._distance, side="right")) - 1, len(self._speeds) - 1)
        room, half = self._at[segment + 1] - self._distance, self._acceleration * duration_s / 2
        braking = np.sqrt(self._node_speeds[segment + 1] ** 2 + 2 * self._acceleration * room + half**2) - half
        return float(min(self._speeds[segment], braking))


def _node_speeds(
    directions: Float64[np.ndarray, "S 8"],
    lengths: Float64[np.ndarray, " S"],
    speeds: Float64[np.ndarray, " S"],
    acceleration_m_s2: float,
) -> Float64[np.ndarray, " P"]:
    """Speed [m/s] at each point of the path: limited by corners, and by the deceleration to later points."""
    turn = np.linalg.norm(np.diff(directions, axis=0), axis=1)
    corner = acceleration_m_s2 * _CORNER_TIME_S / np.maximum(turn, 1e-9)
    inner = np.minimum(corner, np.minimum(speeds[:-1], speeds[1:]))
    nodes = np.concatenate([[0.0], inner, [0.0]])
    for index in range(len(lengths) - 1, -1, -1):
        reachable = np.sqrt(nodes[index + 1] ** 2 + 2 * acceleration_m_s2 * lengths[index])
        nodes[index] = min(nodes[index], reachable)
    return nodes
