"""Speed limit before the walls of the workspace, from the measured tool: an arm follows commands with a delay.

The jogged pose (`app.arm.jogging`) keeps clear of walls by itself; the arm follows it late, and would overshoot by its
motion within that delay.
"""

import numpy as np
from jaxtyping import Float64

from app.arm.walls import beside, between
from app.config import Limits

LATE_S = 0.15
"""Delay [s] from command to motion: up to two cycles of the arm, and its drives."""
_BRAKING_M_S2 = 0.6
"""Assumed deceleration, below the arm's own after a twist."""
_Vector = Float64[np.ndarray, "3"]


def hold_back(linear: _Vector, position: _Vector, limits: Limits) -> _Vector:
    """`linear` [m/s] limited towards walls to a speed from which the tool can stop; a tool outside may come back."""
    low, high = np.asarray(limits.workspace.low), np.asarray(limits.workspace.high)
    held = between(low, high, linear, position, _stoppable)
    for volume in limits.keep_out:
        held = beside(volume, held, position, _stoppable)
    return held


def _stoppable(room_m: _Vector) -> _Vector:
    """Speeds v from which the tool stops within the room: v t + v^2 / 2a = room.

    t is e times the delay: where speed depends on room by a slope above 1 / (e t), a delay of t makes it overshoot (x'
    = -k x(t - T) oscillates where k T > 1 / e: Hale and Verduyn Lunel, Introduction to Functional Differential
    Equations, 1993).
    """
    late = _BRAKING_M_S2 * LATE_S * np.e
    return np.sqrt(late**2 + 2 * _BRAKING_M_S2 * np.maximum(room_m, 0.0)) - late
