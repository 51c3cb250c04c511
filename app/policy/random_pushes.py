"""Random pushes at many speeds and in all directions, as needed to tell causes apart."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.finger_distance import extent_m, nearest_m
from app.core.geometry.track import Track
from app.core.types import Points

PERIOD_S = 0.02
TRAVEL_M = 0.12
REGION = (0.28, -0.32, 0.82, 0.32)
"""Workspace of the tool: x low, y low, x high, y high [m]."""
_CLEAR_M = 0.026
"""Least distance between the object and the place where the tool comes down."""
_DESCENT, _WAIT, _DWELL = 20, 5, 8
"""Periods of going down or up, of standing before the push, and after it."""
_RAMP_S = 0.12
_TRIES = 200
_HOMEWARD = 0.5
"""Share of pushes towards the middle of the table, so that the object does not wander off it."""


@final
@dataclass(frozen=True, kw_only=True)
class PushDesign:
    """Design of a random-push experiment: episodes, pushes in each, speeds [m/s], lengths [m], and what is recorded."""

    episodes: int = 8
    pushes: int = 8
    speeds_m_s: tuple[float, float] = (0.05, 0.30)
    lengths_m: tuple[float, float] = (0.06, 0.14)
    measured: bool = True
    during: bool = True


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Stroke:
    """A push over the table: from `start` [m] along the unit vector `ahead`, in a bow of `bow_m` to its left.

    `yaw_rad`: of the tool, about the vertical.
    """

    start: Float64[np.ndarray, "2"]
    ahead: Float64[np.ndarray, "2"]
    length_m: float
    speed_m_s: float
    bow_m: float = 0.0
    yaw_rad: float = 0.0

    @property
    def end(self) -> Float64[np.ndarray, "2"]:
        """End of the stroke [m]."""
        return self.start + self.length_m * self.ahead

    def track(self, *, start_s: float, height_m: float) -> Track:
        """Track down at its start, along it at its speed, a stop, and up. `height_m`: of the tip while it pushes."""
        side = np.array([-self.ahead[1], self.ahead[0]])
        share = _progress(self.length_m, self.speed_m_s)
        bowed = (4 * self.bow_m * share * (1 - share))[:, None] * side
        level = self.start + share[:, None] * self.length_m * self.ahead + bowed
        down = np.linspace(TRAVEL_M, height_m, _DESCENT)
        first, last = np.repeat(level[:1], _DESCENT + _WAIT, 0), np.repeat(level[-1:], _DWELL + _DESCENT, 0)
        xy = np.concatenate([first, level, last])
        z = np.concatenate([down, np.full(_WAIT + len(level) + _DWELL, height_m), down[::-1]])
        # The tool's z axis points down, as the arm's does: a turn about the vertical after half a turn about x.
        turned = np.tile([0.0, np.cos(self.yaw_rad / 2), np.sin(self.yaw_rad / 2), 0.0], (len(xy), 1))
        poses = np.concatenate([xy, z[:, None], turned], axis=1)
        return Track(times_s=start_s + PERIOD_S * np.arange(len(poses)), poses=poses)


def random_track(
    rng: np.random.Generator,
    x: Points,
    plan: PushDesign,
    *,
    start_s: float,
    height_m: float,
    core_m: tuple[float, float] = (0.0, 0.0),
    region: tuple[float, float, float, float] = REGION,
) -> Track:
    """Random track: down beside the object, through it at a random speed in a slight bow, a stop, and up.

    The tool is turned, but for a flat finger: `core_m` is from its middle to an end of its core (`Finger.half_m`).
    `region`: as `REGION`.
    """
    return random_stroke(rng, x, plan, core_m, region).track(start_s=start_s, height_m=height_m)


def random_stroke(
    rng: np.random.Generator,
    x: Points,
    plan: PushDesign,
    core_m: tuple[float, float] = (0.0, 0.0),
    region: tuple[float, float, float, float] = REGION,
) -> Stroke:
    """Random stroke through the object `x` (N, 3) [m], as in `random_track`."""
    start, ahead, length = _stroke(rng, x, plan, core_m, region)
    speed = float(np.exp(rng.uniform(*np.log(plan.speeds_m_s))))
    bow = float(rng.uniform(-0.25, 0.25) * length)
    yaw = float(rng.uniform(-np.pi, np.pi)) if core_m == (0.0, 0.0) else 0.0
    return Stroke(start=start, ahead=ahead, length_m=length, speed_m_s=speed, bow_m=bow, yaw_rad=yaw)


def stroke_through(
    through: Float64[np.ndarray, "2"],
    ahead: Float64[np.ndarray, "2"],
    *,
    length_m: float,
    speed_m_s: float,
    core_m: tuple[float, float] = (0.0, 0.0),
    yaw_rad: float = 0.0,
) -> Stroke:
    """The straight push along the unit vector `ahead` that begins as far before `through` [m] as random ones do."""
    behind = 1.3 * _CLEAR_M + extent_m(ahead, core_m)
    return Stroke(start=through - behind * ahead, ahead=ahead, length_m=length_m, speed_m_s=speed_m_s, yaw_rad=yaw_rad)


def is_clear(stroke: Stroke, x: Points, core_m: tuple[float, float] = (0.0, 0.0)) -> bool:
    """True if it lies in the region of pushes, and the tool comes down beside the object `x` (N, 3) [m]."""
    low, high = np.array(REGION[:2]), np.array(REGION[2:])
    ends = np.stack([stroke.start, stroke.end])
    inside = bool(((ends > low) & (ends < high)).all())
    return inside and bool(nearest_m(stroke.start[None], x[:, :2], core_m)[0] > _CLEAR_M)


def midway_s(times_s: Float64[np.ndarray, " T"]) -> float:
    """A moment in the later half of the push, of the times of a track that `random_track` drew."""
    first, last = times_s[_DESCENT + _WAIT], times_s[-(_DESCENT + _DWELL)]
    return float(first + 0.6 * (last - first))


def _stroke(
    rng: np.random.Generator,
    x: Points,
    plan: PushDesign,
    core_m: tuple[float, float],
    region: tuple[float, float, float, float],
) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"], float]:
    """Start, direction and length of a push within the region that begins beside the object; the last one tried."""
    low, high = np.array(region[:2]), np.array(region[2:])
    drawn = [_sample_stroke(rng, x, plan, (low + high) / 2, core_m) for _ in range(_TRIES)]
    for start, ahead, length in drawn:
        end = start + length * ahead
        inside = np.all((start > low) & (start < high) & (end > low) & (end < high))
        if inside and nearest_m(start[None], x[:, :2], core_m)[0] > _CLEAR_M:
            return start, ahead, length
    return drawn[-1]


def _sample_stroke(
    rng: np.random.Generator, x: Points, plan: PushDesign, home: Float64[np.ndarray, "2"], core_m: tuple[float, float]
) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"], float]:
    through = x[rng.integers(len(x)), :2].astype(np.float64)
    angle = rng.uniform(0, 2 * np.pi)
    if rng.uniform() < _HOMEWARD:
        to_home = home - through
        angle = np.arctan2(to_home[1], to_home[0]) + rng.uniform(-0.9, 0.9)
    ahead = np.array([np.cos(angle), np.sin(angle)])
    behind = 1.3 * _CLEAR_M + extent_m(ahead, core_m)
    return through - behind * ahead, ahead, float(rng.uniform(*plan.lengths_m))


def _progress(length_m: float, speed_m_s: float) -> Float64[np.ndarray, " T"]:
    """The share of the way made at each period: speeding up, steady, slowing down."""
    ramp = min(_RAMP_S, length_m / speed_m_s / 3)
    moving = length_m / speed_m_s + ramp
    times = np.arange(0, moving + PERIOD_S, PERIOD_S)
    rate = np.clip(np.minimum(times, moving - times) / ramp, 0, 1)
    share = np.concatenate([[0.0], np.cumsum((rate[1:] + rate[:-1]) / 2)])
    return share / share[-1]
