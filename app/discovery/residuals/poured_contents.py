"""Residuals and slopes of a liquid: by how much more of it is in the bowl that stands than was predicted.

A reconstruction fills bowls to the level that cameras see, and takes the rest for held: the clouds of a liquid say how
much is where and nothing else. That is a mean over particles, so that models are compared by it as they are, without a
registration.
"""

from typing import Final

import numpy as np
from jaxtyping import Float64

from app.core.types import Points
from app.discovery.dataset.bowls import PouredBowls

CONTENTS: Final = 1
"""Rows of residuals of a view."""
WHOLE_M: Final = 0.1
"""Residual of all of the liquid [m], so that a hundredth of it counts as a millimetre."""


def contents_m(bowls: PouredBowls, points: Points) -> Float64[np.ndarray, "1"]:
    """The liquid in the bowl that stands, in rows of residuals [m]; NaN of what was not simulated."""
    return np.array([WHOLE_M * bowls.seen_share(points) if np.isfinite(points).all() else np.nan])
