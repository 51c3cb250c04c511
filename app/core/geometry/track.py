"""Trajectory of the tool's tip over time, as commanded, measured or executed."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64, Int64

from app.core.types import Path3


def poses_at(
    at_s: Float64[np.ndarray, " S"], times_s: Float64[np.ndarray, " T"], poses: Float64[np.ndarray, "T D"]
) -> Float64[np.ndarray, "S D"]:
    """Poses at times, straight between those given: x y z, a quaternion w x y z, and what may follow.

    At the times given they are those given, but for the sign of a quaternion.
    """
    sides = np.cumprod(np.where((poses[1:, 3:7] * poses[:-1, 3:7]).sum(1) < 0, -1.0, 1.0))
    smooth = poses.copy()
    smooth[1:, 3:7] *= sides[:, None]
    found = np.stack([np.interp(at_s, times_s, column) for column in smooth.T], axis=1)
    found[:, 3:7] /= np.linalg.norm(found[:, 3:7], axis=1, keepdims=True)
    return found


def upright(turns: Float64[np.ndarray, "S 4"]) -> Float64[np.ndarray, "S 4"]:
    """Quaternions w x y z of an upright tool, from those of the flange that holds it, whose z axis points down."""
    w, x, y, z = turns.T
    return np.stack([x, -w, -z, y], axis=1)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Track:
    """Poses of the tip at increasing times [s]: x y z, a quaternion w x y z. At rest before and after.

    Of a tool that opens on the way the opening [m] follows.
    """

    times_s: Float64[np.ndarray, " T"]
    poses: Float64[np.ndarray, "T D"]

    @property
    def positions(self) -> Path3:
        """Positions of the tip [m], shape (T, 3)."""
        return self.poses[:, :3]

    @property
    def end_s(self) -> float:
        """Time at which it comes to rest [s]."""
        return float(self.times_s[-1])

    def at(self, times_s: Float64[np.ndarray, " S"]) -> Float64[np.ndarray, "S 3"]:
        """The tip's position at other times [m]."""
        return np.stack([np.interp(times_s, self.times_s, self.poses[:, axis]) for axis in range(3)], axis=1)

    def poses_at(self, times_s: Float64[np.ndarray, " S"]) -> Float64[np.ndarray, "S D"]:
        """The tip's pose at other times, as `poses_at` has it."""
        return poses_at(times_s, self.times_s, self.poses)

    def velocity(self, times_s: Float64[np.ndarray, " S"], over_s: float = 0.04) -> Float64[np.ndarray, "S 3"]:
        """The tip's velocity at times [m/s], by a central difference."""
        return (self.at(times_s + over_s / 2) - self.at(times_s - over_s / 2)) / over_s

    def with_positions(self, positions: Path3) -> "Track":
        """The same trajectory with other positions of the tip."""
        return Track(times_s=self.times_s, poses=np.concatenate([positions, self.poses[:, 3:]], axis=1))


def corner_indices(path: Float64[np.ndarray, "T K"], within: float) -> Int64[np.ndarray, " C"]:
    """Indices, the first and the last among them, of points whose straight lines leave the path by `within` at most.

    By Douglas and Peucker 1973, "Algorithms for the reduction of the number of points required to represent a line".
    """
    kept, spans = {0, len(path) - 1}, [(0, len(path) - 1)]
    while spans:
        begin, end = spans.pop()
        if end - begin < 2:
            continue
        away, chord = path[begin + 1 : end] - path[begin], path[end] - path[begin]
        share = np.clip(away @ chord / max(float(chord @ chord), 1e-18), 0.0, 1.0)
        apart = np.linalg.norm(away - share[:, None] * chord, axis=1)
        if apart.max() > within:
            corner = begin + 1 + int(apart.argmax())
            kept.add(corner)
            spans += [(begin, corner), (corner, end)]
    return np.array(sorted(kept), np.int64)
