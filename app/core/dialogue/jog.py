"""Velocity command for the tool."""

from dataclasses import dataclass, field
from typing import final

import numpy as np
from jaxtyping import Float64


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Jog:
    """Tool velocity that holds until the next command, or until none has come for a while: then the tool stops.

    `linear` [m/s] and `angular` [rad/s] in the world frame, about the tool's tip; `opening` [m/s].
    """

    linear: Float64[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))
    angular: Float64[np.ndarray, "3"] = field(default_factory=lambda: np.zeros(3))
    opening: float = 0.0
