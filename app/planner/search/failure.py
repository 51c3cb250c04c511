"""Diagnosis of a decision without a finite branch: the first action that the simulator could not finish."""

from typing import NamedTuple, final

import jax
import numpy as np
from jaxtyping import Array, Float

from app.planner.search.request import PlanRequest
from app.planner.search.tree import TreeConfig, start, state_after, wanted_action
from app.sim.diagnosis.object_state import ObjectState


@final
class Failed(NamedTuple):
    """An action that ended in NaN: branch and depth, the state before it, and the tool path."""

    branch: int
    depth: int
    state: ObjectState
    tool: Float[Array, "1 T C"]


def failed_action(search: TreeConfig, request: PlanRequest) -> Failed | None:
    """The first one of the tree that the request's seed samples, before descent; None where all branches stay finite.

    Descent leaves a branch where it began unless it gets cheaper, and nothing is cheaper than NaN: what failed then
    fails here, unless a rod does so in pieces alone.
    """
    tree = start(search, request)
    now = tree.now
    for depth in range(search.depth):
        action = search.space.project(wanted_action(search, tree, depth, now), now)
        path, after = search.space.tool_path(action, now.tool), state_after(search, tree.phi, now, action)
        broken = ~np.isfinite(jax.device_get(after.x)).all(axis=(1, 2))
        if broken.any():
            branch = int(np.argmax(broken))
            only = slice(branch, branch + 1)
            return Failed(branch, depth, type(now.state)(*(part[only] for part in now.state)), path[only])
        now = after
    return None
