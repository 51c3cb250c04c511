"""States of branches at moments between now and their end: simulated once more, in pieces."""

from functools import partial
from itertools import pairwise
from typing import Final, NamedTuple

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from app.planner.search.tree import TreeConfig
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


def film(
    search: TreeConfig,
    phi: Float[Array, "B P"],
    now: PlanningState,
    actions: Float[Array, "B D A"],
    final: Float[Array, "B N 3"],
) -> RolloutFrames:
    """The branches that make `actions` from `now` on, which end in `final`, or no moments where `search` has no `part`.

    It costs one simulation of the branches: 0.19 s beside the 3.7 s of a rope's decision on two cores. On a GPU, one
    that is interrupted adds up its forces in another order, which may move a particle by a hair; the end is what was
    decided by.
    """
    if search.part is None:
        return RolloutFrames(np.zeros((len(actions), 0, 0, 3), np.float32), np.zeros((len(actions), 0, 3), np.float32))
    frames, tools = jax.device_get(_frames_of(search, phi, now, jnp.asarray(actions)))
    return RolloutFrames(np.concatenate([frames[:, :-1], thin_out(np.asarray(final))[:, None]], axis=1), tools)


def compile_film(
    search: TreeConfig, phi: Float[Array, "B P"], now: PlanningState, actions: Float[Array, "B D A"]
) -> None:
    """Compile what `film` will use."""
    if search.part is not None:
        _frames_of.lower(search, phi, now, actions).compile()


def thin_out(x: Float32[np.ndarray, "*axes N 3"]) -> Float32[np.ndarray, "*axes K 3"]:
    """Every k-th particle, so that at most `MOST_PARTICLES` are left."""
    return x[..., :: _stride(x.shape[-2]), :]


@partial(jax.jit, static_argnums=0)
def _frames_of(
    search: TreeConfig, phi: Float[Array, "B P"], now: PlanningState, actions: Float[Array, "B D A"]
) -> tuple[Float[Array, "B F K 3"], Float[Array, "B F 3"]]:
    """Action by action, and each of them piece by piece."""
    assert search.part is not None
    depth = actions.shape[1]
    frames, tools = [now.x], list[Array]()
    for step in range(depth):
        path = search.space.tool_path(actions[:, step], now.tool)
        cuts = _cuts(path.shape[1] - 1, max(MOMENTS // depth, 1))
        tools += [path[:, cut, :3] for cut in (cuts[1:] if tools else cuts)]
        state = now.state
        for begin, end in pairwise(cuts):
            state = search.part(phi, state, path[:, begin : end + 1], now.x)
            frames.append(state.x)
        rested = state.resting() if search.at_rest else state
        now = PlanningState(rested, search.space.after(actions[:, step], now.tool))
    stride = _stride(now.x.shape[1])
    return jnp.stack(frames, axis=1)[:, :, ::stride], jnp.stack(tools, axis=1)


def _cuts(substeps: int, pieces: int) -> list[int]:
    """Substeps at which an action is cut, from 0 to its end; pieces differ by a substep at most."""
    return [round(cut) for cut in np.linspace(0, substeps, pieces + 1)]


def _stride(count: int) -> int:
    return -(-count // MOST_PARTICLES)
