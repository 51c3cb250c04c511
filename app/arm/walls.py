"""Velocity limits before walls, for any braking law: one rule for all workspace limiters. Pure."""

from collections.abc import Callable
from typing import Final, TypeAlias

import numpy as np
from jaxtyping import Float64

from app.config import KeepOut

Law: TypeAlias = Callable[[Float64[np.ndarray, " A"]], Float64[np.ndarray, " A"]]
"""Braking law: the largest speeds [m/s] from which the tool stops within the room [m]; zero where there is none."""

_INSIDE_M_S: Final = 1e3
"""Penalty above any speed: a face that the tool has passed already is not chosen while there is another."""


def between(
    low: Float64[np.ndarray, " A"],
    high: Float64[np.ndarray, " A"],
    velocity: Float64[np.ndarray, " A"],
    position: Float64[np.ndarray, " A"],
    law: Law,
) -> Float64[np.ndarray, " A"]:
    """`velocity` [m/s] limited along each axis by the wall in front; a tool outside may come back."""
    return np.clip(velocity, -law(position - low), law(high - position))


def beside(
    volume: KeepOut,
    velocity: Float64[np.ndarray, "3"],
    position: Float64[np.ndarray, "3"],
    law: Law,
    margin_m: float = 0.0,
) -> Float64[np.ndarray, "3"]:
    """`velocity` [m/s] limited towards that face of the volume which costs the least speed.

    A tool that stays on its side of one face stays out; `margin_m` moves the faces outward. Where some face's bound was
    kept before, the reduction now is no more than braking by the law gives.
    """
    low, high = np.asarray(volume.low), np.asarray(volume.high)
    side = np.where(position >= (low + high) / 2, 1.0, -1.0)
    face = np.where(side > 0, high, low) + side * margin_m
    room, towards = side * (position - face), -side * velocity
    most = law(room)
    # Inside the volume every bound is zero, and the nearest face is the way out.
    lost = np.maximum(towards - most, 0.0) + np.where(room >= 0, 0.0, _INSIDE_M_S - room)
    axis = int(lost.argmin())
    held = velocity.copy()
    held[axis] = -side[axis] * min(towards[axis], most[axis])
    return held
