"""Residuals and slopes of a liquid: by how much more of it is in the bowl that stands than was predicted.

A reconstruction fills bowls to the level that cameras see, and takes the rest for held: the clouds of a liquid say how
much is where and nothing else. That is a mean over particles, so that models are compared by it as they are, without a
registration. The level after a motion and the one before the next motion of the episode are two looks at one rest.
"""

from collections.abc import Sequence
from typing import Final

import numpy as np
from jaxtyping import Float64

from app.core.types import Points
from app.discovery.dataset.bowls import PouredBowls
from app.discovery.dataset.study import Push

CONTENTS: Final = 1
"""Rows of residuals of a view."""
WHOLE_M: Final = 0.1
"""Residual of all of the liquid [m], so that a hundredth of it counts as a millimetre."""


_APART: Final = 0.15
"""Difference of two looks, in shares of the liquid, from which they are not of one rest: levels err by 0.03 each."""


def standing_shares(bowls: PouredBowls, pushes: Sequence[Push]) -> Float64[np.ndarray, "K 2"]:
    """Shares of the liquid in the bowl that stands before and after each push, of all looks at it meanwhile."""
    seen = np.array([[bowls.seen_share(view.points) for view in (push.before, push.after)] for push in pushes])
    shares = seen.copy()
    for k in range(1, len(pushes)):
        looks = seen[k - 1, 1], seen[k, 0]
        if pushes[k].episode == pushes[k - 1].episode and abs(looks[0] - looks[1]) < _APART:
            shares[k - 1, 1] = shares[k, 0] = np.mean(looks)
    return shares


def contents_m(bowls: PouredBowls, points: Points) -> Float64[np.ndarray, "1"]:
    """The liquid in the bowl that stands, in rows of residuals [m]; NaN of what was not simulated."""
    return np.array([WHOLE_M * bowls.seen_share(points) if np.isfinite(points).all() else np.nan])
