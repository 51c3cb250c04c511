"""The tree of trajectories: first actions that are random, the policy's or the last plan's, continued by the policy."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import pairwise
from typing import NamedTuple, Protocol, TypeVar, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, PRNGKeyArray

from app.core.messages import Origin
from app.core.types import Points, ToolPose
from app.planner.actions.actions import ActionSpace
from app.planner.search.cost import Terms, Weights, step_terms
from app.planner.search.request import PlanRequest
from app.policy.base import PARKED_POSE, PlanningState, Policy, Prepared, StatefulPolicy
from app.sim.diagnosis.object_state import ObjectState
from app.sim.state import State

TreeT = TypeVar("TreeT")

Advance = Callable[[Float[Array, "B P"], ObjectState, Float[Array, "B T C"]], ObjectState]
"""The simulator: parameters, state before, tool path -> state after."""
Part = Callable[[Float[Array, "B P"], ObjectState, Float[Array, "B T C"], Float[Array, "B N 3"]], ObjectState]
"""The simulator of a piece of an action, as `Advance` but for the particles as the action began."""


class Begin(Protocol):
    """The state of an object of which the cameras see where its particles are."""

    def __call__(self, x: Float[Array, "B N 3"], near: Float[Array, "2 n"] | None = None) -> ObjectState:
        """Unmoving at `x` [m]. `near`: where the centreline of a rope was predicted to be [m]."""
        ...


def at_rest(x: Float[Array, "B N 3"], near: Float[Array, "2 n"] | None = None) -> State:
    """Unmoving and undeformed particles, which have no centreline that could be `near`."""
    del near
    return State.at_rest(x)


@final
@dataclass(frozen=True, kw_only=True)
class TreeConfig:
    """Configuration of the tree search; the same for every decision of a task and preset.

    Without `guided` no policy takes part: all actions are drawn at random. `part`: the simulator of a piece of an
    action, which does not come to rest at its end as `advance` does where actions end `at_rest`; None if no moments
    in between are shown. `origin`: the name of the policy's branch.
    `descended`: so many of the cheapest branches are descended from, half of them where it is None. `redraws`: before
    that, random branches are drawn anew about the cheapest, once for each of these spreads [scale of actions].
    `policy_shares`: in place of as many random branches, ones that make such a share of each of the policy's actions.
    """

    space: ActionSpace
    policy: Policy
    weights: Weights
    advance: Advance
    branches: int
    depth: int
    begin: Begin = at_rest
    guided: bool = True
    part: Part | None = None
    at_rest: bool = True
    origin: Origin = "policy"
    descended: int | None = None
    redraws: tuple[float, ...] = ()
    policy_shares: tuple[float, ...] = ()


class Rollout(NamedTuple):
    """Rollouts of B branches. `actions` are those that were simulated: projected onto the feasible set.

    `first`: the particles after the first action, and `centreline` the nodes of a rope then [m]; `final`: at the end.
    """

    actions: Float[Array, "B D A"]
    first: Float[Array, "B N 3"]
    centreline: Float[Array, "B 2 n"]
    final: Float[Array, "B N 3"]
    terms: Terms
    cost: Float[Array, " B"]
    allowed: Bool[Array, " B"]

    @property
    def finite(self) -> Bool[Array, " B"]:
        """True if cost and particles are finite."""
        return jnp.isfinite(self.cost) & jnp.isfinite(self.final).all((1, 2))

    @property
    def masked_cost(self) -> Float[Array, " B"]:
        """The cost; infinite where a branch is not finite, or has an action that may not be made."""
        return jnp.where(self.finite & self.allowed, self.cost, jnp.inf)


class RootBatch(NamedTuple):
    """Roots of a tree: model and state of each branch, first actions, and later ones where the policy has no say.

    `given`: which of the later ones are taken; in place of others the policy acts, and this share of it is made, as of
    the first ones. Without a policy all are given.
    """

    prepared: Prepared
    phi: Float[Array, "B P"]
    now: PlanningState
    first: Float[Array, "B A"]
    later: Float[Array, "B L A"]
    given: Bool[Array, "B L"]
    shares: Float[Array, " B"]


def start(search: TreeConfig, request: PlanRequest) -> RootBatch:
    """First actions: the policy's, parts of it, then random ones; unguided all are random, and those after them.

    The last branch is the remainder of the plan before, where there is one, and a branch beside the policy's.
    """
    rng, count, depth = np.random.default_rng(request.seed), search.branches, search.depth
    observed, pose, here = request.observed, tool_pose(request), situation(search, request)
    phi, now = roots(request, here, count)
    kept = start_by_policy(search, observed, request.goal, here) if search.guided else (None, [])
    own = policy_shares(search)
    firsts = [share * action for action in kept[1] for share in own]
    missing = count - len(own)
    random = [np.array(search.space.sample(rng, observed, pose, missing))] if missing else []
    drawn = [search.space.sample(rng, observed, pose, count) for _ in range(0 if search.guided else depth - 1)]
    later = np.stack(drawn, axis=1) if drawn else np.zeros((count, depth - 1, search.space.size), np.float32)
    given = np.full(later.shape[:2], not search.guided)
    if continues(search, request) and (rest := request.remainder) is not None:
        random[0][-1], later[-1, : len(rest) - 1], given[-1, : len(rest) - 1] = rest[0], rest[1:depth], True
    return RootBatch(
        prepared=kept[0],
        phi=phi,
        now=now,
        first=jnp.concatenate([*firsts, *random]),
        later=jnp.asarray(later),
        given=jnp.asarray(given),
        shares=jnp.concatenate([jnp.asarray(own, jnp.float32), jnp.ones(missing, jnp.float32)]),
    )


def descended_count(search: TreeConfig) -> int:
    """Number of branches that are descended from: half of them, rounded up, where the search does not say."""
    half = -(-search.branches // 2)
    return half if search.descended is None else min(search.descended, search.branches)


def policy_shares(search: TreeConfig) -> tuple[float, ...]:
    """The share of the policy's actions that each of the first branches makes: all of it, and then others.

    A branch is left for the remainder of the plan before, as far as there is one. Unguided there are none.
    """
    return (1.0, *search.policy_shares[: max(search.branches - 2, 0)]) if search.guided else ()


def own_branches(search: TreeConfig) -> Bool[np.ndarray, " B"]:
    """Mask of the branches that are the policy's or parts of it, or may be the remainder of the plan before."""
    mine = np.zeros(search.branches, bool)
    mine[: len(policy_shares(search))] = True
    mine[-1] |= search.depth > 1
    return mine


def random_key(seed: int) -> PRNGKeyArray:
    """Random key of what is drawn after the first actions, which the action space draws from the seed itself."""
    return jax.random.key(int(np.random.default_rng([seed, 1]).integers(2**31)))


def first_of(candidates: TreeT, count: int) -> TreeT:
    """The first `count` of arrays of candidates."""

    def head(leaf: Array) -> Array:
        return leaf[:count]

    return jax.tree.map(head, candidates)


def continues(search: TreeConfig, request: PlanRequest) -> bool:
    """True if a branch, the last, begins with the remainder of the plan before."""
    return request.remainder is not None and search.branches > search.guided


def start_by_policy(
    search: TreeConfig, observed: Points, goal: Points, here: PlanningState
) -> tuple[Prepared, list[Float[Array, "1 A"]]]:
    """The observation as the policy has prepared it, and the action that it takes first in the situation `here`."""
    prepared = search.policy.prepare(observed, goal)
    return prepared, [first_action(search.policy, prepared, here)]


@partial(jax.jit, static_argnums=0)
def first_action(policy: Policy, prepared: Prepared, now: PlanningState) -> Float[Array, "B A"]:
    """First action of a policy in a state."""
    return (policy.first if isinstance(policy, StatefulPolicy) else policy.act)(prepared, now).mean


def tool_pose(request: PlanRequest) -> ToolPose:
    """Pose of the tool as an action begins; parked where actions begin anywhere."""
    return PARKED_POSE if request.tool is None else request.tool


def situation(search: TreeConfig, request: PlanRequest) -> PlanningState:
    """The object as it is seen and the tool, of one candidate."""
    known = None if request.near is None else jnp.asarray(request.near)
    state = search.begin(jnp.asarray(request.observed)[None], known)
    return PlanningState(state, jnp.asarray(tool_pose(request), jnp.float32)[None])


def roots(request: PlanRequest, here: PlanningState, count: int) -> tuple[Float[Array, "B P"], PlanningState]:
    """Model and situation of so many branches."""
    return jnp.repeat(jnp.asarray(request.phi)[None], count, axis=0), _repeat(here, count)


@partial(jax.jit, static_argnums=1)
def _repeat(here: PlanningState, count: int) -> PlanningState:
    """The same for `count` candidates."""
    return jax.tree.map(partial(jnp.repeat, repeats=count, axis=0), here)


def wanted_action(search: TreeConfig, tree: RootBatch, step: int, now: PlanningState) -> Float[Array, "B A"]:
    """Action number `step` of each branch in the situation that it meets, before it is projected.

    After the first, one that is given, or what the policy does.
    """
    if not step:
        return tree.first
    wanted = tree.later[:, step - 1]
    if not search.guided:
        return wanted
    acted = tree.shares[:, None] * search.policy.act(tree.prepared, now).mean
    return jnp.where(tree.given[:, step - 1, None], wanted, acted)


@partial(jax.jit, static_argnums=0)
def state_after(
    search: TreeConfig, phi: Float[Array, "B P"], now: PlanningState, action: Float[Array, "B A"]
) -> PlanningState:
    """The situation after an action of each candidate."""
    state = search.advance(phi, now.state, search.space.tool_path(action, now.tool))
    return PlanningState(state, search.space.after(action, now.tool))


@partial(jax.jit, static_argnums=0)
def simulate(
    search: TreeConfig,
    phi: Float[Array, "B P"],
    now: PlanningState,
    goal: Float[Array, "M 3"],
    actions: Float[Array, "B D A"],
) -> Rollout:
    """Simulate every branch and cost it: see `follow`. Traced once for all that use it."""
    return follow(search, phi, now, goal, lambda step, _: actions[:, step])[0]


def follow(
    search: TreeConfig,
    phi: Float[Array, "B P"],
    now: PlanningState,
    goal: Float[Array, "M 3"],
    wanted: Callable[[int, PlanningState], Float[Array, "B A"]],
    pieces: int = 0,
) -> tuple[Rollout, list[Float[Array, "B F N 3"]]]:
    """Simulate and cost the actions that are `wanted` of each branch, given their number and the situation then.

    Each action is simulated in F `pieces`, after which the particles are returned too, or as a whole (F = 0).
    Differentiable in actions, `now` and `phi`. Actions are projected onto what is allowed in the state they meet;
    gradients pass the projection straight through (its own derivative would forget how a start that was moved aside
    got there).
    """
    taken, passed = list[Float[Array, "B A"]](), list[Float[Array, "B F N 3"]]()
    seen = [now]
    terms = Terms(*jnp.zeros((3, len(phi))))
    allowed = jnp.ones(len(phi), bool)
    for step in range(search.depth):
        made = _make_step(search, pieces, phi, seen[-1], goal, wanted(step, seen[-1]))
        taken.append(made.action)
        passed.append(made.passed)
        allowed &= made.allowed
        terms = terms.plus(made.terms, search.weights.discount**step)
        seen.append(made.then)
    rollout = Rollout(
        actions=jnp.stack(taken, axis=1),
        first=seen[1].x,
        centreline=seen[1].state.centreline,
        final=seen[-1].x,
        terms=terms,
        cost=terms.total(search.weights),
        allowed=allowed,
    )
    return rollout, passed


class _Step(NamedTuple):
    """One action of each candidate: as it was simulated, if it may be made, what it costs, and the situation then.

    `passed`: the particles after each of its pieces.
    """

    action: Float[Array, "B A"]
    allowed: Bool[Array, " B"]
    terms: Terms
    then: PlanningState
    passed: Float[Array, "B F N 3"]


@partial(jax.jit, static_argnums=(0, 1))
def _make_step(
    search: TreeConfig,
    pieces: int,
    phi: Float[Array, "B P"],
    now: PlanningState,
    goal: Float[Array, "M 3"],
    wanted: Float[Array, "B A"],
) -> _Step:
    here, start = jax.lax.stop_gradient((wanted, now))
    action = wanted + (search.space.project(here, start) - here)
    path = search.space.tool_path(action, now.tool)
    passed = _in_pieces(search, phi, now.state, path, cuts_of(path, pieces)) if pieces else ()
    state = _final_state(search, passed[-1]) if passed else search.advance(phi, now.state, path)
    return _Step(
        action=action,
        allowed=search.space.is_allowed(action, now),
        terms=step_terms(now.x, state.x, goal, path, search.weights),
        then=PlanningState(state, search.space.after(action, now.tool)),
        passed=jnp.stack([part.x for part in passed], axis=1) if passed else now.x[:, None][:, :0],
    )


def _in_pieces(
    search: TreeConfig,
    phi: Float[Array, "B P"],
    state: ObjectState,
    path: Float[Array, "B T C"],
    cuts: Sequence[int],
) -> Sequence[ObjectState]:
    """The states at these substeps of an action but the first, each simulated from the one before."""
    assert search.part is not None
    began, states = state.x, list[ObjectState]()
    for first, last in pairwise(cuts):
        state = search.part(phi, state, path[:, first : last + 1], began)
        states.append(state)
    return states


def cuts_of(path: Float[Array, "B T C"], pieces: int) -> Sequence[int]:
    """Substeps at which an action is cut, from 0 to its end; pieces differ by a substep at most."""
    return [round(cut) for cut in np.linspace(0, path.shape[1] - 1, pieces + 1)]


def _final_state(search: TreeConfig, state: ObjectState) -> ObjectState:
    """The state in which the last piece of an action leaves the object for the next one."""
    return state.resting() if search.at_rest else state
