"""Pushes drawn at random, at many speeds and in all directions: what it takes to tell causes apart."""

from dataclasses import dataclass
from typing import final

import numpy as np
from jaxtyping import Float64

from app.core.finger_distance import extent_m, nearest_m
from app.core.track import Track
from app.core.types import Points

PERIOD_S = 0.02
TRAVEL_M = 0.12
REGION = (0.28, -0.32, 0.82, 0.32)
"""Where the tool may be: x low, y low, x high, y high [m]."""
_CLEAR_M = 0.026
"""How far beside the object the tool comes down."""
_DESCENT, _WAIT, _DWELL = 20, 5, 8
"""Periods of going down or up, of standing before the push, and after it."""
_RAMP_S = 0.12
_TRIES = 200
_HOMEWARD = 0.5
"""Share of pushes towards the middle of the table, so that the object does not wander off it."""


@final
@dataclass(frozen=True, kw_only=True)
class Plan:
    """How many episodes of how many pushes, how fast [m/s] and how far [m]; what the record has besides."""

    episodes: int = 8
    pushes: int = 8
    speeds_m_s: tuple[float, float] = (0.05, 0.30)
    lengths_m: tuple[float, float] = (0.06, 0.14)
    measured: bool = True
    during: bool = True


def random_track(
    rng: np.random.Generator,
    x: Points,
    plan: Plan,
    *,
    start_s: float,
    height_m: float,
    core_m: tuple[float, float] = (0.0, 0.0),
    region: tuple[float, float, float, float] = REGION,
) -> Track:
    """Down beside the object, through it at a speed of its own in a slight bow, a stop, and up.

    The tool is turned, but for a flat finger: `core_m` is from its middle to an end of its core (`Finger.half_m`).
    `region`: as `REGION`.
    """
    start, ahead, length = _stroke(rng, x, plan, core_m, region)
    speed = float(np.exp(rng.uniform(*np.log(plan.speeds_m_s))))
    side, bow = np.array([-ahead[1], ahead[0]]), rng.uniform(-0.25, 0.25) * length
    share = _progress(length, speed)
    level = start + share[:, None] * length * ahead + (4 * bow * share * (1 - share))[:, None] * side
    down = np.linspace(TRAVEL_M, height_m, _DESCENT)
    xy = np.concatenate([np.repeat(level[:1], _DESCENT + _WAIT, 0), level, np.repeat(level[-1:], _DWELL + _DESCENT, 0)])
    z = np.concatenate([down, np.full(_WAIT + len(level) + _DWELL, height_m), down[::-1]])
    yaw = rng.uniform(-np.pi, np.pi) if core_m == (0.0, 0.0) else 0.0
    # The tool's z axis points down, as the arm's does: a turn about the vertical after half a turn about x.
    turned = np.tile([0.0, np.cos(yaw / 2), np.sin(yaw / 2), 0.0], (len(xy), 1))
    poses = np.concatenate([xy, z[:, None], turned], axis=1)
    return Track(times_s=start_s + PERIOD_S * np.arange(len(poses)), poses=poses)


def midway_s(times_s: Float64[np.ndarray, " T"]) -> float:
    """A moment in the later half of the push, of the times of a track that `random_track` drew."""
    first, last = times_s[_DESCENT + _WAIT], times_s[-(_DESCENT + _DWELL)]
    return float(first + 0.6 * (last - first))


def _stroke(
    rng: np.random.Generator,
    x: Points,
    plan: Plan,
    core_m: tuple[float, float],
    region: tuple[float, float, float, float],
) -> tuple[Float64[np.ndarray, "2"], Float64[np.ndarray, "2"], float]:
    """Start, direction and length of a push within the region that begins beside the object; the last one tried."""
    low, high = np.array(region[:2]), np.array(region[2:])
    drawn = [_drawn(rng, x, plan, (low + high) / 2, core_m) for _ in range(_TRIES)]
    for start, ahead, length in drawn:
        end = start + length * ahead
        inside = np.all((start > low) & (start < high) & (end > low) & (end < high))
        if inside and nearest_m(start[None], x[:, :2], core_m)[0] > _CLEAR_M:
            return start, ahead, length
    return drawn[-1]


def _drawn(
    rng: np.random.Generator, x: Points, plan: Plan, home: Float64[np.ndarray, "2"], core_m: tuple[float, float]
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
