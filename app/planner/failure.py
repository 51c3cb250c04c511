"""Which action of a decision the simulator could not finish: what a decision without a finite branch died of."""

from typing import NamedTuple, final

import jax
import numpy as np
from jaxtyping import Array, Float, Float32

from app.core.types import Points
from app.planner.tree import Search, start


@final
class Failed(NamedTuple):
    """An action that ended in NaN: branch and depth, the particles before it [m], and the tool path [m]."""

    branch: int
    depth: int
    x: Float[Array, "1 N 3"]
    tool: Float[Array, "1 T A"]


def failed_action(
    search: Search, observed: Points, goal: Points, phi: Float32[np.ndarray, " P"], seed: int
) -> Failed | None:
    """The first one of the tree that this seed samples, before descent; None where all branches stay finite.

    Descent leaves a branch where it began unless it gets cheaper, and nothing is cheaper than NaN: what failed then
    fails here.
    """
    prepared, parameters, x, action = start(search, observed, goal, phi, seed)
    for depth in range(search.depth):
        path = search.space.tool_path(search.space.project(action, x))
        after = search.advance(parameters, x, path)
        broken = ~np.isfinite(jax.device_get(after)).all(axis=(1, 2))
        if broken.any():
            branch = int(np.argmax(broken))
            return Failed(branch, depth, x[branch : branch + 1], path[branch : branch + 1])
        x, action = after, search.policy.act(prepared, after)
    return None
