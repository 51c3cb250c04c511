"""Random carrying motions of a gripper: short moves that lift, swing, turn, drag and lower what it holds."""

from typing import Final

import numpy as np
from jaxtyping import Float64

from app.core.geometry.track import Track
from app.core.types import Points, ToolPose
from app.policy.random_pushes import PERIOD_S, PushDesign

LENGTHS_M: Final = (0.06, 0.20)
SPEEDS_M_S: Final = (0.08, 0.40)
"""Peak speeds of moves."""
LOW_M: Final = (0.40, -0.30, 0.02)
HIGH_M: Final = (0.70, -0.05, 0.30)
"""Corners of the box in which moves end: in front of a rack, which a cloth does not reach from there."""
_MOVES: Final = (2, 3)
_PEAK = 1.875
"""Peak speed over mean speed of a move with the least jerk."""
_LONGEST_S = 2.0
_FEWEST_S = 1.2
_CLOSING_S, _STILL_S, _DWELL_S = 0.3, 0.1, 0.16
"""Time in which the fingers close, of rest before the first move, and after the last."""
_LEAST_LIFT_M = 0.08
"""Height of the first place to which a cloth is carried that lay on the table."""
_TURN_RAD, _MOST_RAD = 0.6, 0.9
"""Largest turn of a move about the vertical, and of the gripper at all."""
_INSET_M = 0.012
"""Distance of the grasp from the edge."""
_TRIES = 100


def carry_design(episodes: int, pushes: int) -> PushDesign:
    """Design of an experiment with so many random carries."""
    return PushDesign(episodes=episodes, pushes=pushes, speeds_m_s=SPEEDS_M_S, lengths_m=LENGTHS_M)


def random_grasp(rng: np.random.Generator, edge: Points, *, height_m: float, opening_m: float) -> ToolPose:
    """Pose of the open gripper about a point of the `edge` (M, 3) [m] of a cloth, turned at random."""
    middle, at = edge[:, :2].mean(0), edge[rng.integers(len(edge)), :2].astype(np.float64)
    inward = (middle - at) / np.linalg.norm(middle - at)
    yaw = rng.uniform(-_MOST_RAD, _MOST_RAD)
    return np.array([*(at + _INSET_M * inward), height_m, *_turn(yaw), opening_m])


def random_carry(
    rng: np.random.Generator, start: ToolPose, plan: PushDesign, *, start_s: float, closed_m: float
) -> Track:
    """Random carry from the pose `start`: two or three straight moves, each at rest at its ends, with a turn.

    A gripper that is open there closes to `closed_m` [m] first. Moves have the least jerk (Flash and Hogan 1985, "The
    coordination of arm movements"). The poses of the track end with the opening [m].
    """
    places, yaws = _places(rng, start, plan)
    speed = float(np.exp(rng.uniform(*np.log(plan.speeds_m_s))))
    lengths = np.linalg.norm(np.diff(places, axis=0), axis=1)
    durations = _PEAK * lengths / speed
    durations *= np.clip(durations.sum(), _FEWEST_S, _LONGEST_S) / durations.sum()
    rows = [_still(places[0], yaws[0], float(start[7]), _STILL_S)]
    if start[7] > closed_m:
        rows.append(_closing(places[0], yaws[0], float(start[7]), closed_m))
    for move, duration in enumerate(durations):
        share = _least_jerk(np.arange(1, max(2, round(duration / PERIOD_S)) + 1) / max(2, round(duration / PERIOD_S)))
        place = places[move] + share[:, None] * (places[move + 1] - places[move])
        rows.append(_rows(place, yaws[move] + share * (yaws[move + 1] - yaws[move]), closed_m))
    rows.append(_still(places[-1], yaws[-1], closed_m, _DWELL_S))
    poses = np.concatenate(rows)
    return Track(times_s=start_s + PERIOD_S * np.arange(len(poses)), poses=poses)


def _places(
    rng: np.random.Generator, start: ToolPose, plan: PushDesign
) -> tuple[Float64[np.ndarray, "W 3"], Float64[np.ndarray, " W"]]:
    """Places and yaws of the ends of all moves, the start first."""
    places, yaws = [start[:3]], [2 * float(np.arctan2(start[5], start[4]))]
    for move in range(int(rng.integers(_MOVES[0], _MOVES[1] + 1))):
        least_m = _LEAST_LIFT_M if move == 0 and start[2] < LOW_M[2] else LOW_M[2]
        places.append(_next(rng, places[-1], plan, least_m))
        yaws.append(float(np.clip(yaws[-1] + rng.uniform(-_TURN_RAD, _TURN_RAD), -_MOST_RAD, _MOST_RAD)))
    return np.array(places), np.array(yaws)


def _next(
    rng: np.random.Generator, here: Float64[np.ndarray, "3"], plan: PushDesign, least_m: float
) -> Float64[np.ndarray, "3"]:
    """A place at a random distance and direction within the box, or the nearest one in it after many tries."""
    low, high = np.array([*LOW_M[:2], least_m]), np.array(HIGH_M)
    there = here
    for _ in range(_TRIES):
        ahead = rng.standard_normal(3)
        there = here + rng.uniform(*plan.lengths_m) * ahead / np.linalg.norm(ahead)
        if np.all((there >= low) & (there <= high)):
            return there
    return np.clip(there, low, high)


def _least_jerk(time: Float64[np.ndarray, " S"]) -> Float64[np.ndarray, " S"]:
    return time**3 * (10 - 15 * time + 6 * time**2)


def _still(place: Float64[np.ndarray, "3"], yaw: float, opening_m: float, duration_s: float) -> np.ndarray:
    count = round(duration_s / PERIOD_S)
    return _rows(np.tile(place, (count, 1)), np.full(count, yaw), opening_m)


def _closing(place: Float64[np.ndarray, "3"], yaw: float, opening_m: float, closed_m: float) -> np.ndarray:
    rows = _still(place, yaw, closed_m, _CLOSING_S)
    rows[:, 7] = np.linspace(opening_m, closed_m, len(rows))
    return rows


def _rows(
    places: Float64[np.ndarray, "S 3"], yaws: Float64[np.ndarray, " S"], opening_m: float
) -> Float64[np.ndarray, "S 8"]:
    turns = np.array([_turn(yaw) for yaw in yaws.tolist()])
    return np.concatenate([places, turns, np.full((len(places), 1), opening_m)], axis=1)


def _turn(yaw: float) -> tuple[float, float, float, float]:
    """Quaternion w x y z of a tool that points down, turned about the vertical."""
    return 0.0, float(np.cos(yaw / 2)), float(np.sin(yaw / 2)), 0.0
