"""Pose diversity of the views, its sufficiency for a calibration, and advice where it is insufficient."""

import numpy as np
from jaxtyping import Float64

from app.core.geometry.hand_eye import Spread
from app.perception.calibration.se3 import log, nearest_rotation

FEWEST_VIEWS = 5
"""Fewest views: three would do without noise, but could not reveal an outlier."""
LEAST_TURN_DEG = 4.0
"""Least root mean square about the second axis: half of a tilt of 10 degrees to either side."""
GOOD_TURN_DEG = 10.0


def spread_of(T_world_gripper: Float64[np.ndarray, "V 4 4"]) -> Spread:
    """Spread of the gripper's poses, independent of any frame: rotations from their mean, positions from theirs."""
    R = T_world_gripper[:, :3, :3]
    turns = log(R @ nearest_rotation(R.mean(axis=0)).T)
    shifts = T_world_gripper[:, :3, 3]
    return Spread(turns_deg=_three(np.degrees(_axes(turns))), shifts_m=_three(_axes(shifts - shifts.mean(axis=0))))


def lack(spread: Spread, views: int) -> str | None:
    """Reason why these views are insufficient, with advice; None where they suffice."""
    if views < FEWEST_VIEWS:
        there = "There is 1 view" if views == 1 else f"There are {views} views"
        return f"{there} and {FEWEST_VIEWS} are needed at least; 15 to 25 are good. Take more."
    first, second, _ = spread.turns_deg
    if first < LEAST_TURN_DEG:
        return (
            f"The views differ in position alone (turned by {first:.1f} degrees), which says nothing of where the "
            "camera stands; tilt the gripper by 20 degrees and more about two axes."
        )
    if second < LEAST_TURN_DEG:
        return (
            f"The views are all turned about one axis ({first:.0f} degrees about it, {second:.1f} about the next), "
            "along which the camera's place stays open; tilt the gripper by 20 degrees and more about a second axis."
        )
    return None


def _axes(vectors: Float64[np.ndarray, "V 3"]) -> Float64[np.ndarray, "3"]:
    return np.linalg.svd(vectors, compute_uv=False) / np.sqrt(len(vectors)) if len(vectors) > 2 else _few(vectors)


def _few(vectors: Float64[np.ndarray, "V 3"]) -> Float64[np.ndarray, "3"]:
    padded = np.concatenate([vectors, np.zeros((3 - len(vectors), 3))])
    return np.linalg.svd(padded, compute_uv=False) / np.sqrt(max(len(vectors), 1))


def _three(values: Float64[np.ndarray, "3"]) -> tuple[float, float, float]:
    return float(values[0]), float(values[1]), float(values[2])
