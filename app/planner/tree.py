"""The tree of trajectories: k random first actions and one of the policy, each continued by the policy."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32

from app.core.types import Points
from app.planner.actions import ActionSpace
from app.planner.cost import Terms, Weights, step_terms
from app.policy.base import Policy, Prepared

Advance = Callable[[Float[Array, "B P"], Float[Array, "B N 3"], Float[Array, "B T 3"]], Float[Array, "B N 3"]]
"""The simulator from rest to rest: parameters, particles before, tool path -> particles after."""


@final
@dataclass(frozen=True, kw_only=True)
class Search:
    """What a decision is searched with; the same for every decision of a task and preset."""

    space: ActionSpace
    policy: Policy
    weights: Weights
    advance: Advance
    branches: int
    depth: int


class Rollout(NamedTuple):
    """B branches as simulated. `actions` are those that were simulated: projected onto what is allowed."""

    actions: Float[Array, "B D A"]
    first: Float[Array, "B N 3"]
    final: Float[Array, "B N 3"]
    terms: Terms
    cost: Float[Array, " B"]
    allowed: Bool[Array, " B"]


class Start(NamedTuple):
    """What a tree grows from: model and state for each branch, and the first actions."""

    prepared: Prepared
    phi: Float[Array, "B P"]
    x: Float[Array, "B N 3"]
    first: Float[Array, "B A"]


def start(search: Search, observed: Points, goal: Points, phi: Float32[np.ndarray, " P"], seed: int) -> Start:
    """First actions: the policy's, then k = branches - 1 random ones."""
    prepared = search.policy.prepare(observed, goal)
    policy = search.policy.act(prepared, jnp.asarray(observed)[None])
    random = search.space.sample(np.random.default_rng(seed), observed, search.branches - 1)
    return Start(
        prepared=prepared,
        phi=jnp.repeat(jnp.asarray(phi)[None], search.branches, axis=0),
        x=jnp.repeat(jnp.asarray(observed)[None], search.branches, axis=0),
        first=jnp.concatenate([policy, random]),
    )


def roll_out(search: Search, tree: Start) -> Float[Array, "B D A"]:
    """All actions of all branches: after the first, the policy acts on the simulated states."""
    x = tree.x
    actions = [search.space.project(tree.first, x)]
    for _ in range(search.depth - 1):
        x = search.advance(tree.phi, x, search.space.tool_path(actions[-1]))
        actions.append(search.space.project(search.policy.act(tree.prepared, x), x))
    return jnp.stack(actions, axis=1)


def simulate(
    search: Search,
    phi: Float[Array, "B P"],
    x: Float[Array, "B N 3"],
    goal: Float[Array, "M 3"],
    actions: Float[Array, "B D A"],
) -> Rollout:
    """Simulate every branch and cost it. Differentiable in `actions`, `x` and `phi`.

    Actions are projected onto what is allowed in the state they meet; gradients pass the projection straight through
    (its own derivative would forget how a start that was moved aside got there).
    """
    taken: list[Float[Array, "B A"]] = []
    states = [x]
    terms = Terms(jnp.zeros(len(x)), jnp.zeros(len(x)))
    allowed = jnp.ones(len(x), bool)
    for step in range(search.depth):
        wanted = actions[:, step]
        here, start = jax.lax.stop_gradient((wanted, states[-1]))
        taken.append(wanted + (search.space.project(here, start) - here))
        allowed &= search.space.allowed(taken[-1], states[-1])
        path = search.space.tool_path(taken[-1])
        states.append(search.advance(phi, states[-1], path))
        terms = terms.plus(step_terms(states[-2], states[-1], goal, path), search.weights.discount**step)
    return Rollout(jnp.stack(taken, axis=1), states[1], states[-1], terms, terms.total(search.weights), allowed)
