"""States of branches at moments between now and their end: actions are simulated in pieces."""

from collections.abc import Callable
from functools import partial
from typing import Final, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Int

from app.planner.search.tree import (
    Rollout,
    RootBatch,
    TreeConfig,
    cuts_of,
    follow,
    wanted_action,
)
from app.policy.base import PlanningState

MOMENTS: Final = 8
"""Moments after now; more if a branch has more actions: the ends of actions are moments."""
MOST_PARTICLES: Final = 600
"""Largest number in a frame: of more, every second, third, ... is kept, so that recordings stay small."""


class RolloutFrames(NamedTuple):
    """B branches at F moments, evenly spread from now to the end; the first moment is now.

    `frames`: the particles [m], thinned to at most `MOST_PARTICLES`; `tools`: the tool's tip [m].
    """

    frames: Float32[np.ndarray, "B F N 3"]
    tools: Float32[np.ndarray, "B F 3"]

    def ending_in(self, final: Float32[np.ndarray, "B N 3"]) -> "RolloutFrames":
        """The same, but for the last moment, which is as it was decided by."""
        if not self.frames.size:
            return self
        return self._replace(frames=np.concatenate([self.frames[:, :-1], thin_out(final)[:, None]], axis=1))

    def with_those(self, others: "RolloutFrames", at: Int[np.ndarray, " K"]) -> "RolloutFrames":
        """These, but for the branches `at`, which look like the `others`."""
        frames, tools = self.frames.copy(), self.tools.copy()
        frames[at], tools[at] = others.frames, others.tools
        return RolloutFrames(frames, tools)


class ShownRollout(NamedTuple):
    """Rollouts, and the moments of them as `RolloutFrames`, on the device."""

    rollout: Rollout
    frames: Float[Array, "B F N 3"]
    tools: Float[Array, "B F 3"]

    @property
    def moments(self) -> RolloutFrames:
        """The moments, on the host."""
        return RolloutFrames(*jax.device_get((self.frames, self.tools)))


@partial(jax.jit, static_argnums=0)
def grow(search: TreeConfig, tree: RootBatch, goal: Float[Array, "M 3"]) -> ShownRollout:
    """The branches of the tree: the policy acts in what it meets, and what comes of it is costed, in one simulation."""
    return _shown(search, tree.phi, tree.now, goal, partial(wanted_action, search, tree))


@partial(jax.jit, static_argnums=0)
def resimulate(
    search: TreeConfig,
    phi: Float[Array, "B P"],
    now: PlanningState,
    goal: Float[Array, "M 3"],
    actions: Float[Array, "B D A"],
) -> ShownRollout:
    """Branches that make these actions from `now` on.

    What is simulated in pieces may end elsewhere than as a whole: rods by up to 0.3 mm, on a GPU anything by a hair.
    """
    return _shown(search, phi, now, goal, lambda step, _: actions[:, step])


def thin_out(x: Float32[np.ndarray, "*axes N 3"]) -> Float32[np.ndarray, "*axes K 3"]:
    """Every k-th particle, so that at most `MOST_PARTICLES` are left."""
    return x[..., :: _stride(x.shape[-2]), :]


def _shown(
    search: TreeConfig,
    phi: Float[Array, "B P"],
    now: PlanningState,
    goal: Float[Array, "M 3"],
    wanted: Callable[[int, PlanningState], Float[Array, "B A"]],
) -> ShownRollout:
    """Simulated action by action, and each of them piece by piece; without a `part` as a whole, and without moments."""
    pieces = 0 if search.part is None else max(MOMENTS // search.depth, 1)
    rollout, passed = follow(search, phi, now, goal, wanted, pieces)
    if not pieces:
        return ShownRollout(rollout, jnp.zeros((len(phi), 0, 0, 3)), jnp.zeros((len(phi), 0, 3)))
    tools, tool = list[Array](), now.tool
    for step in range(search.depth):
        action = rollout.actions[:, step]
        path = search.space.tool_path(action, tool)
        tools += [path[:, cut, :3] for cut in cuts_of(path, pieces)[bool(tools) :]]
        tool = search.space.after(action, tool)
    frames = jnp.concatenate([now.x[:, None], *passed], axis=1).at[:, -1].set(rollout.final)
    return ShownRollout(rollout, frames[:, :, :: _stride(frames.shape[2])], jnp.stack(tools, axis=1))


def _stride(count: int) -> int:
    return -(-count // MOST_PARTICLES)
