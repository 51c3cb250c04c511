"""When a costly world need not be simulated: a cell that waits shall not fall behind while nothing happens."""

from typing import Final, final

import numpy as np
from jaxtyping import Float

from app.rig.simulated.world import Nodes

_STILL_M_S: Final = 0.004
"""All but the fastest hundredth of what is at rest is slower than this: about what a cell's noise hides in a second."""
_AFTER_S: Final = 0.3
"""What moves on comes by within this time."""
_SAME_M: Final = 1e-6
"""A tool that moves less has not moved."""


@final
class Rest:
    """Watches one world. What sleeps stays as it is until the tool moves; the same calls sleep at the same time."""

    def __init__(self) -> None:
        self._still_s = 0.0

    def lasts(self, here: Float[np.ndarray, " K"], there: Float[np.ndarray, " K"]) -> bool:
        """Whether nothing would happen while the tool goes from `here` to `there`; a tool that moves ends it."""
        if np.abs(there - here).max() > _SAME_M:
            self._still_s = 0.0
        return self._still_s >= _AFTER_S

    def watch(self, before: Nodes, after: Nodes, duration_s: float) -> None:
        """Note what was simulated with the tool at rest."""
        speed = float(np.quantile(np.linalg.norm(after - before, axis=1), 0.99)) / duration_s
        self._still_s = self._still_s + duration_s if speed < _STILL_M_S else 0.0
