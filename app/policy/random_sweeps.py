"""Random sweeps of loose pieces by a paddle, at many speeds and in all directions."""

from typing import Final

import numpy as np
from jaxtyping import Float64

from app.core.types import Points
from app.policy.random_pushes import REGION, PushDesign, Stroke

LENGTHS_M: Final = (0.06, 0.22)
"""Range of the sweeps' lengths: the longest takes less than 5 s at the lowest speed."""
_CLEAR_M = 0.008
"""Least distance between the paddle that comes down and the surface of any piece."""
_BACK_M = 0.08
"""Longest way back from the nearest place behind a piece, to where the paddle is clear of all; at most half a sweep."""
_TRIES = 400
_HOMEWARD = 0.5
"""Share of sweeps towards the middle of the table, so that the pieces do not wander off it."""


def sweep_design(episodes: int, pushes: int) -> PushDesign:
    """Design of an experiment with so many random sweeps."""
    return PushDesign(episodes=episodes, pushes=pushes, lengths_m=LENGTHS_M)


def random_sweep(
    rng: np.random.Generator,
    x: Points,
    plan: PushDesign,
    *,
    radius_m: float,
    half_m: tuple[float, float],
    region: tuple[float, float, float, float] = REGION,
) -> Stroke:
    """Random straight sweep through the pieces: down beside all of them, the paddle turned across its way.

    `x (N, 3)` [m]: points of the pieces, whose surfaces are `radius_m` about them; `half_m`: half the paddle's width,
    and half its thickness. `region`: as `REGION`, of the paddle's middle. Where no sweep of many is clear, it is the
    clearest of them.
    """
    low, high = np.array(region[:2]), np.array(region[2:])
    least_m = radius_m + _CLEAR_M
    drawn = (_sample(rng, x, plan, (low + high) / 2, least_m + half_m[1]) for _ in range(_TRIES))
    best, most_m = None, -np.inf
    for stroke in drawn:
        ends = np.stack([stroke.start, stroke.end])
        inside = bool(np.all((ends > low) & (ends < high)))
        gap_m = clearance_m(stroke, x, half_m) - (0.0 if inside else np.inf)
        if best is None or gap_m > most_m:
            best, most_m = stroke, gap_m
        if most_m > least_m:
            break
    assert best is not None
    return best


def clearance_m(stroke: Stroke, x: Points, half_m: tuple[float, float]) -> float:
    """Distance [m], seen from above, from the paddle where it comes down to the nearest of the points."""
    offset = x[:, :2] - stroke.start
    along, across = offset @ stroke.ahead, offset @ np.array([-stroke.ahead[1], stroke.ahead[0]])
    beyond = np.abs(np.stack([across, along], axis=1)) - half_m
    return float(np.linalg.norm(np.maximum(beyond, 0.0), axis=1).min())


def yaw_across(ahead: Float64[np.ndarray, "2"]) -> float:
    """The lesser angle [rad] by which a paddle is across its way: both of its faces are alike."""
    yaw = float(np.arctan2(ahead[1], ahead[0])) - np.pi / 2
    return float(yaw - np.pi * np.round(yaw / np.pi))


def _sample(
    rng: np.random.Generator, x: Points, plan: PushDesign, home: Float64[np.ndarray, "2"], behind_m: float
) -> Stroke:
    through = x[rng.integers(len(x)), :2].astype(np.float64)
    angle = rng.uniform(0, 2 * np.pi)
    if rng.uniform() < _HOMEWARD:
        to_home = home - through
        angle = np.arctan2(to_home[1], to_home[0]) + rng.uniform(-0.9, 0.9)
    ahead = np.array([np.cos(angle), np.sin(angle)])
    length = float(rng.uniform(*plan.lengths_m))
    start = through - (behind_m + rng.uniform(0, min(_BACK_M, length / 2))) * ahead
    speed = float(np.exp(rng.uniform(*np.log(plan.speeds_m_s))))
    return Stroke(start=start, ahead=ahead, length_m=length, speed_m_s=speed, yaw_rad=yaw_across(ahead))
