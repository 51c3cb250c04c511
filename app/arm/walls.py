"""What a tool may still do before a wall, whatever it brakes with: one rule for all who hold one back. Pure."""

from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np
from jaxtyping import Float64

from app.config import KeepOut

Law: TypeAlias = Callable[[Float64[np.ndarray, " A"]], Float64[np.ndarray, " A"]]
"""The speeds [m/s] from which so much room [m] is enough to stop in; zero where there is none."""

_INSIDE_M_S: Final = 1e3
"""More than any speed: a face that the tool has passed already keeps it out of nothing while there is another."""


def between(
    low: Float64[np.ndarray, " A"],
    high: Float64[np.ndarray, " A"],
    velocity: Float64[np.ndarray, " A"],
    position: Float64[np.ndarray, " A"],
    law: Law,
) -> Float64[np.ndarray, " A"]:
    """`velocity` [m/s], along each axis no faster than the wall in front allows; what is outside may come back."""
    return np.clip(velocity, -law(position - low), law(high - position))


def beside(
    volume: KeepOut,
    velocity: Float64[np.ndarray, "3"],
    position: Float64[np.ndarray, "3"],
    law: Law,
    margin_m: float = 0.0,
) -> Float64[np.ndarray, "3"]:
    """`velocity` [m/s], no faster towards that face of the volume for which the least has to be given up.

    A tool that stays on its side of one face stays out; `margin_m` is how much nearer the faces are than they are.
    Where some face's bound was kept before, what is asked for now is no more than braking by the law gives.
    """
    low, high = np.asarray(volume.low), np.asarray(volume.high)
    side = np.where(position >= (low + high) / 2, 1.0, -1.0)
    face = np.where(side > 0, high, low) + side * margin_m
    room, towards = side * (position - face), -side * velocity
    most = law(room)
    # Where it is inside already every bound is zero, and the nearest face is the way out.
    lost = np.maximum(towards - most, 0.0) + np.where(room >= 0, 0.0, _INSIDE_M_S - room)
    axis = int(lost.argmin())
    held = velocity.copy()
    held[axis] = -side[axis] * min(towards[axis], most[axis])
    return held
