"""Time parametrisation of waypoints: straight segments, rounded where they blend, each at its own speed."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation, Slerp

from app.core.types import Transform
from app.rig.kinova import gen3
from app.rig.kinova.api.messages import CartesianWaypoint, Pose

ACCELERATION_M_S2 = 1.0
"""Assumed; Kinova publishes none for trajectories."""
_APART_M, _APART_RAD, _FEWEST, _CORNER = 0.004, np.radians(2.0), 5, 9
"""Sampling of the path: largest distance and angle between samples, fewest samples a segment and a rounded corner."""
_NOTHING = 1e-9


@final
@dataclass(frozen=True, kw_only=True)
class Leg:
    """Segment between waypoints; the `cut_m` at its start and end belong to rounded corners."""

    start: Float64[np.ndarray, "3"]
    end: Float64[np.ndarray, "3"]
    turn_rad: float
    speed_m_s: float
    turning_rad_s: float
    cut_m: tuple[float, float]

    @property
    def length_m(self) -> float:
        """Length of the whole segment [m]."""
        return float(np.linalg.norm(self.end - self.start))

    def at(self, fraction: float) -> Float64[np.ndarray, "3"]:
        """Point at a fraction of the segment."""
        return self.start + fraction * (self.end - self.start)

    @property
    def fractions(self) -> tuple[float, float]:
        """Fractions at which it leaves the corner before it and enters the one after."""
        length = max(self.length_m, _NOTHING)
        return self.cut_m[0] / length, 1.0 - self.cut_m[1] / length


@final
class TimedPath:
    """Tool path as a function of time, from rest to rest."""

    def __init__(self, start: Transform, waypoints: tuple[CartesianWaypoint, ...]) -> None:
        frames = [start, *(gen3.transform(each.pose or Pose()) for each in waypoints)]
        legs = _legs(frames, waypoints)
        keys, points, speeds, turning, stops = _sample(legs)
        slerp = Slerp(np.arange(len(frames)), Rotation.from_matrix(np.array([frame[:3, :3] for frame in frames])))
        rotations = slerp(keys)
        away = np.linalg.norm(np.diff(points, axis=0), axis=1)
        turned = (rotations[:-1].inv() * rotations[1:]).magnitude()
        # Rotation counts as path length where it takes longer, so that one speed keeps both limits.
        self._times, self._speeds = _times(np.maximum(away, turned * speeds / turning), speeds, stops)
        self._keys, self._points, self._slerp = keys, points, slerp
        self._left_m = float(away.sum()) - np.concatenate([[0.0], np.cumsum(away)])

    @property
    def duration_s(self) -> float:
        """Time from the start to rest at the last waypoint [s]."""
        return float(self._times[-1])

    def short_of_end_s(self, short_m: float) -> float:
        """Time at which `short_m` of the path is left [s]."""
        return float(self._times[int(np.argmax(self._left_m <= max(short_m, 0.0) + _NOTHING))])

    def speed(self, time_s: float) -> float:
        """Speed of the tool at a time [m/s]."""
        return float(np.linalg.norm(self._point(time_s + 0.005) - self._point(time_s - 0.005)) / 0.01)

    def waypoint(self, time_s: float) -> int:
        """Index of the next waypoint at a time, from 0."""
        return min(int(self._between(time_s, self._keys)), int(self._keys[-1]) - 1)

    def at(self, time_s: float) -> Transform:
        """Pose of the tool at a time."""
        frame = np.eye(4)
        key = self._between(time_s, self._keys)
        frame[:3, :3], frame[:3, 3] = self._slerp(key).as_matrix(), self._point(time_s)
        return frame

    def _point(self, time_s: float) -> Float64[np.ndarray, "3"]:
        return np.array([self._between(time_s, self._points[:, axis]) for axis in range(3)])

    def _between(self, time_s: float, values: np.ndarray) -> float:
        """Interpolate sampled values at a time, at constant acceleration between samples."""
        index = int(np.clip(np.searchsorted(self._times, time_s, side="right") - 1, 0, len(self._times) - 2))
        lasts_s = float(self._times[index + 1] - self._times[index])
        before, after = self._speeds[index], self._speeds[index + 1]
        u = float(np.clip((time_s - self._times[index]) / max(lasts_s, _NOTHING), 0.0, 1.0))
        gone = u * (2 * before + u * (after - before)) / max(before + after, _NOTHING)
        return float(values[index] + gone * (values[index + 1] - values[index]))


def _legs(frames: list[Transform], waypoints: tuple[CartesianWaypoint, ...]) -> list[Leg]:
    legs, before = list[Leg](), 0.0
    for start, end, waypoint in zip(frames, frames[1:], waypoints, strict=False):
        last = len(legs) == len(waypoints) - 1
        radius = 0.0 if last else waypoint.blending_radius
        turn = float(Rotation.from_matrix(start[:3, :3].T @ end[:3, :3]).magnitude())
        legs.append(
            Leg(
                start=start[:3, 3],
                end=end[:3, 3],
                turn_rad=turn,
                speed_m_s=min(waypoint.maximum_linear_velocity or gen3.LINEAR_M_S, gen3.LINEAR_M_S),
                turning_rad_s=np.radians(min(waypoint.maximum_angular_velocity or gen3.ANGULAR_DEG_S, 100.0)),
                cut_m=(before, radius),
            )
        )
        before = radius
    return legs


def _sample(legs: list[Leg]) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """Keys (counting waypoints) and points of the samples, both speeds of each gap, and the samples to stop at."""
    keys, points, speeds, turning, stops = [0.0], [legs[0].start], list[float](), list[float](), [True]
    for index, leg in enumerate(legs):
        first, last = leg.fractions
        count = max(_FEWEST, int(leg.length_m / _APART_M), int(leg.turn_rad / _APART_RAD))
        for fraction in np.linspace(first, last, count + 1)[1:]:
            keys.append(index + float(fraction))
            points.append(leg.at(float(fraction)))
            speeds.append(leg.speed_m_s)
            turning.append(leg.turning_rad_s)
            stops.append(False)
        if leg.cut_m[1] > 0:
            _round(leg, legs[index + 1], index, keys, points)
            speeds += [min(leg.speed_m_s, legs[index + 1].speed_m_s)] * _CORNER
            turning += [min(leg.turning_rad_s, legs[index + 1].turning_rad_s)] * _CORNER
            stops += [False] * _CORNER
        else:
            stops[-1] = True
    return np.array(keys), np.array(points), np.array(speeds), np.array(turning), np.array(stops)


def _round(leg: Leg, following: Leg, index: int, keys: list[float], points: list[np.ndarray]) -> None:
    """Append a parabola that leaves one segment and enters the next tangentially."""
    first, last = leg.fractions[1], following.fractions[0]
    enter, leave = leg.at(first), following.at(last)
    for u in np.linspace(0.0, 1.0, _CORNER + 1)[1:]:
        keys.append(index + first + float(u) * (1 - first + last))
        points.append((1 - u) ** 2 * enter + 2 * u * (1 - u) * leg.end + u**2 * leave)


def _times(ways: np.ndarray, speeds: np.ndarray, stops: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Times and speeds at the samples, within speed and acceleration limits, at rest at the stops."""
    allowed = np.minimum(np.append(speeds, speeds[-1]), np.insert(speeds, 0, speeds[0]))
    allowed[stops] = 0.0
    for index in range(len(ways)):
        allowed[index + 1] = min(allowed[index + 1], np.sqrt(allowed[index] ** 2 + 2 * ACCELERATION_M_S2 * ways[index]))
    for index in reversed(range(len(ways))):
        allowed[index] = min(allowed[index], np.sqrt(allowed[index + 1] ** 2 + 2 * ACCELERATION_M_S2 * ways[index]))
    mean = np.maximum((allowed[1:] + allowed[:-1]) / 2, _NOTHING)
    return np.concatenate([[0.0], np.cumsum(np.where(ways > _NOTHING, ways / mean, 0.0))]), allowed
