"""Sleep detection for costly worlds, so that a waiting cell does not fall behind while nothing happens."""

from typing import Final, final

import numpy as np
from jaxtyping import Float

from app.rig.simulated.worlds.world import Nodes

_STILL_M_S: Final = 0.004
"""Speed below which an object is at rest, for all but its fastest hundredth: about a cell's noise in a second."""
_AFTER_S: Final = 0.3
"""Time of rest before the world sleeps [s], within which a continuing motion would show."""
_SAME_M: Final = 1e-6
"""Largest motion of a tool at rest."""


@final
class Rest:
    """Sleep detector of one world, which stays frozen until the tool moves; the same calls sleep at the same time."""

    def __init__(self) -> None:
        self._still_s = 0.0

    def lasts(self, here: Float[np.ndarray, " K"], there: Float[np.ndarray, " K"]) -> bool:
        """True where nothing would happen while the tool goes from `here` to `there`; a moving tool wakes the world."""
        if np.abs(there - here).max() > _SAME_M:
            self._still_s = 0.0
        return self._still_s >= _AFTER_S

    def watch(self, before: Nodes, after: Nodes, duration_s: float) -> None:
        """Update from a step that was simulated with the tool at rest."""
        speed = float(np.quantile(np.linalg.norm(after - before, axis=1), 0.99)) / duration_s
        self._still_s = self._still_s + duration_s if speed < _STILL_M_S else 0.0
