"""What the tool may still do before a wall, by where it was measured: an arm obeys a little late.

The tool that the hand moves (`app.arm.jogging`) keeps clear of walls by itself; the arm follows it with a delay, and
would be as far beyond as it moves meanwhile.
"""

import numpy as np
from jaxtyping import Float64

from app.arm.walls import beside, between
from app.config import Limits

LATE_S = 0.15
"""From what is told to what moves: a command waits for up to two cycles of the arm, the arm for its drives."""
_BRAKING_M_S2 = 0.6
"""Less than what the arm brakes with after a twist."""
_Vector = Float64[np.ndarray, "3"]


def held_back(linear: _Vector, position: _Vector, limits: Limits) -> _Vector:
    """`linear` [m/s], towards walls no faster than from where the tool can still stop; a tool outside may come back."""
    low, high = np.asarray(limits.workspace.low), np.asarray(limits.workspace.high)
    held = between(low, high, linear, position, _stoppable)
    for volume in limits.keep_out:
        held = beside(volume, held, position, _stoppable)
    return held


def _stoppable(room_m: _Vector) -> _Vector:
    """The speeds from which the room is enough: that with v t + v^2 / 2a = room.

    t is e times the delay: where speed follows room by a slope of more than 1 / (e t), a delay of t makes it overshoot
    (x' = -k x(t - T) oscillates where k T > 1 / e: Hale and Verduyn Lunel, Introduction to Functional Differential
    Equations, 1993).
    """
    late = _BRAKING_M_S2 * LATE_S * np.e
    return np.sqrt(late**2 + 2 * _BRAKING_M_S2 * np.maximum(room_m, 0.0)) - late
