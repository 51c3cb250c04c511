"""Learners, and the policy that each yields: a network's parameters behind the interface of all policies."""

import hashlib
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from functools import partial
from typing import Any, NamedTuple, Protocol, Self, TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Bool, Float, Float32, PRNGKeyArray

from app.core.types import Points, ToolPose
from app.policy.base import PARKED_POSE, ActionDistribution, PlanningState
from app.policy.learned.sight import PolicyObservation, Views, sight
from app.policy.symmetry import Isometry, Symmetry
from app.sim.diagnosis.object_state import ObjectState

Params: TypeAlias = Mapping[str, Any]
"""A pytree of arrays, as flax has it."""
Chunk: TypeAlias = tuple[int, int]
"""T small moves of K numbers each, of which an action of A = T K numbers is made."""

_FADING = 0.01
"""`m` of the paper's public program: decay of the weights, from the oldest intended action to the present one."""


class Space(Protocol):
    """Action space as learning needs it, a part of `app.planner.actions.actions.ActionSpace`. Frozen and hashable."""

    @property
    def chunk(self) -> Chunk:
        """Shape (T, K) of its small moves."""
        ...

    @property
    def anywhere(self) -> bool:
        """True if an action may begin anywhere, so that the tool's pose does not matter."""
        ...

    def is_allowed(self, actions: Float[Array, "B A"], now: PlanningState) -> Bool[Array, " B"]:
        """True for each action that is feasible."""
        ...

    def transform(self, actions: Float[Array, "B A"], by: Isometry) -> Float[Array, "B A"]:
        """The same actions after the table is moved by an isometry."""
        ...

    def project(self, actions: Float[Array, "B A"], now: PlanningState) -> Float[Array, "B A"]:
        """The nearest feasible actions."""
        ...

    def tool_path(self, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B T C"]:
        """The tools' coordinates as the simulator takes them."""
        ...

    def after(self, actions: Float[Array, "B A"], tool: Float[Array, "B 8"]) -> Float[Array, "B 8"]:
        """Tool poses after the actions."""
        ...


Advance: TypeAlias = Callable[[Float[Array, "B P"], ObjectState, Float[Array, "B T C"]], ObjectState]
"""The simulator: parameters, state before, tool path -> state after."""


@final
@dataclass(frozen=True, kw_only=True)
class TrainingSimulator:
    """A simulator that learners may try in, with the parameters `phi` of its model.

    `begin`: the simulator's state of an object that is seen.
    """

    advance: Advance
    begin: Callable[[Float[Array, "B N 3"]], ObjectState]
    phi: tuple[float, ...]


@final
@dataclass(frozen=True, kw_only=True)
class Lessons:
    """Training setup of a task's policies. `world`: for learners that learn by simulation; acting does not use it."""

    space: Space
    symmetry: Symmetry
    views: Views
    world: TrainingSimulator | None = None

    def act_in_frame(
        self, goal: Float[Array, "B M 3"], now: PlanningState, act: Callable[[PolicyObservation], ActionDistribution]
    ) -> ActionDistribution:
        """Action distribution of `act`, computed in the frame of the task's symmetry and moved back to the table."""
        frame = self.symmetry.frame(goal, now.x)
        here = PlanningState.at_rest(frame.places(now.x))._replace(tool=frame.poses(now.tool))  # Motion is not seen.
        acted = act(self.observation(frame.places(goal), here))
        return _move(self.space, acted, frame.inverse) if self.symmetry.turns else acted

    def observation(self, goal: Float[Array, "B M 3"], now: PlanningState) -> PolicyObservation:
        """Observation of the policy; a tool whose pose does not matter is shown where it is before the first action.

        Its pose after a demonstrated action would reveal which one that was, and simulated situations lack it.
        """
        away = jnp.broadcast_to(jnp.asarray(PARKED_POSE, jnp.float32), now.tool.shape)
        return sight(self.views, goal, now._replace(tool=away) if self.space.anywhere else now)


def _move(space: Space, acted: ActionDistribution, by: Isometry) -> ActionDistribution:
    """Moved on the table, as actions are; what is spread evenly one way there is so in parts of several here."""

    def moved(actions: Float[Array, "B A"]) -> Float[Array, "B A"]:
        return space.transform(actions, by)

    def along(number: Float[Array, " A"]) -> Float[Array, "B A"]:
        return jax.jvp(moved, (acted.mean,), (acted.spread * number,))[1]

    parts = jax.vmap(along)(jnp.eye(acted.mean.shape[1]))
    return ActionDistribution(moved(acted.mean), jnp.linalg.norm(parts, axis=0))


@final
class Scale(NamedTuple):
    """Normalisation of a network's outputs: mean and standard deviation of each number of the small moves."""

    mean: Float32[np.ndarray | Array, "T K"]
    std: Float32[np.ndarray | Array, "T K"]

    def to(self, actions: Float[Array, "B A"]) -> Float[Array, "B T K"]:
        """An action's numbers to a network's."""
        return (actions.reshape(-1, *self.mean.shape) - self.mean) / self.std

    def back(self, moves: Float[Array, "B T K"], spread: Float[Array, "B T K"]) -> ActionDistribution:
        """A network's numbers to actions."""
        shape = (len(moves), -1)
        return ActionDistribution((moves * self.std + self.mean).reshape(shape), (spread * self.std).reshape(shape))


@final
class Shown(NamedTuple):
    """B demonstrated situations and the actions taken there; a JAX pytree.

    `made`: that action and the W - 1 that followed; `after`: the object after each [m]. `counts` is 1, and 0 for
    those past the end of the demonstration. All is in the frames of the task's symmetry, or near them.
    """

    seen: PolicyObservation
    goal: Float[Array, "B M 3"]
    now: PlanningState
    made: Float[Array, "B W A"]
    after: Float[Array, "B W N 3"]
    counts: Float[Array, "B W"]

    @property
    def actions(self) -> Float[Array, "B A"]:
        """The actions taken there."""
        return self.made[:, 0]


class Learner(Protocol):
    """A way to learn: a network, what it minimises, and how it acts. A frozen dataclass of numbers."""

    @property
    def window(self) -> int:
        """W: number of successive actions and outcomes that its loss uses."""
        ...

    def begin(self, key: PRNGKeyArray, seen: PolicyObservation, how: Lessons) -> Params:
        """Parameters to begin with, for such sights and the actions of such lessons."""
        ...

    def loss(self, params: Params, key: PRNGKeyArray, shown: Shown, how: Lessons, scale: Scale) -> Float[Array, ""]:
        """Training loss: distance between the policy's actions and those shown; `key` for random draws."""
        ...

    def ahead(self, how: Lessons) -> int:
        """L: number of actions beyond the next that it predicts."""
        ...

    def act(self, params: Params, seen: PolicyObservation, how: Lessons, scale: Scale) -> ActionDistribution:
        """Action distribution of the policy."""
        ...


class NextOnly:
    """Mixin of a learner that predicts the next action alone."""

    def ahead(self, how: Lessons) -> int:
        """Number of further actions: none."""
        del how
        return 0


class PolicyContext(NamedTuple):
    """Inputs of a learned policy that stay fixed during planning: parameters, and the goal [m]; a JAX pytree.

    `meant`: the action that each of the L last decisions intended for now, newest first, where `told` is 1.
    """

    params: Params
    scale: Scale
    goal: Float[Array, "1 M 3"]
    meant: Float[Array, "L A"]
    told: Float[Array, " L"]


@final
@dataclass(frozen=True, kw_only=True)
class LearnedPolicy:
    """A policy as `app.policy.base.Policy` has it. Two of the same `digest`, which is of their parameters, are one.

    The parameters are handed over with every observation: what is compiled has none of them inside, and is the same
    program, which a cache on disk finds again, for all policies of one kind and task.

    `meant`: of the last decisions, the newest first, what it meant to do after what it did then, L actions each.
    """

    learner: Learner
    how: Lessons
    params: Params = field(compare=False, repr=False)
    scale: Scale = field(compare=False, repr=False)
    digest: str
    meant: tuple[Float32[np.ndarray, "L A"], ...] = field(default=(), compare=False, repr=False)

    @classmethod
    def of(cls, learner: Learner, how: Lessons, params: Params, scale: Scale) -> Self:
        """The policy with the digest of these numbers."""
        digest = hashlib.sha256()
        for array in jax.tree_util.tree_leaves((params, tuple(scale))):
            digest.update(np.ascontiguousarray(np.asarray(array, np.float32)).tobytes())
        how = replace(how, world=None)
        return cls(learner=learner, how=how, params=params, scale=scale, digest=digest.hexdigest())

    def prepare(self, observed: Points, goal: Points) -> PolicyContext:
        """The goal, beside what was learned and meant."""
        del observed
        ahead, told = self.learner.ahead(self.how), len(self.meant)
        meant = np.zeros((ahead, int(np.prod(self.how.space.chunk))), np.float32)
        for ago, later in enumerate(self.meant):
            meant[ago] = later[ago]
        known = jnp.asarray(np.arange(ahead) < told, jnp.float32)
        return PolicyContext(self.params, self.scale, jnp.asarray(goal)[None], jnp.asarray(meant), known)

    def first(self, prepared: PolicyContext, now: PlanningState) -> ActionDistribution:
        """Mean of `act` and of the actions intended for now before, weighed by exp(-m i), the oldest of i = 0.

        Temporal ensembling: Zhao et al. 2023, "Learning fine-grained bimanual manipulation", algorithm 2, lines 5 to 7.
        """
        acted = self.act(prepared, now)
        # Of so many that were told, the newest one's i is one less, and that of what is meant now the next.
        count, rank = prepared.told.sum(), jnp.arange(len(prepared.told))
        weights = prepared.told * jnp.exp(-_FADING * (count - 1 - rank))
        newest = jnp.exp(-_FADING * count)
        mean = (newest * acted.mean + weights @ prepared.meant) / (newest + weights.sum())
        return acted._replace(mean=mean)

    def after(self, observed: Points, goal: Points, tool: ToolPose | None) -> Self:
        """The policy after that decision: it remembers the actions that it intends next."""
        if not self.learner.ahead(self.how):
            return self
        later = _later(self, self.prepare(observed, goal), PlanningState.at_rest(jnp.asarray(observed)[None], tool))
        kept = (np.asarray(later[0]), *self.meant)[: self.learner.ahead(self.how)]
        return replace(self, meant=kept)

    def act(self, prepared: PolicyContext, now: PlanningState) -> ActionDistribution:
        """Action distribution of the network for the observation of each candidate."""
        params, scale, one, *_ = prepared
        goal = jnp.broadcast_to(one, (len(now.x), *one.shape[1:]))
        return self.how.act_in_frame(goal, now, lambda seen: self.learner.act(params, seen, self.how, scale))


@partial(jax.jit, static_argnums=0)
def _later(policy: LearnedPolicy, prepared: PolicyContext, now: PlanningState) -> Float[Array, "B L A"]:
    later = policy.act(prepared, now).later
    assert later is not None, "whoever looks ahead says what comes later"
    return later
