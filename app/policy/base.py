"""Initial policies: they propose an action for a state, inside rollouts as well."""

from typing import Any, NamedTuple, Protocol, Self, TypeAlias, final, runtime_checkable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from app.core.motion import pointing_down
from app.core.types import Points, ToolPose
from app.sim.diagnosis.object_state import ObjectState
from app.sim.state import State

Prepared: TypeAlias = Any
"""A pytree of arrays that only the policy which made it understands."""


PARKED_POSE = pointing_down(np.array([0.30, 0.0, 0.30]))
"""Parked tool pose, for a tool that may begin its next action anywhere: high over the table."""


@final
class PlanningState(NamedTuple):
    """State of B candidates when they choose an action; a JAX pytree. `tool`: pose and opening of each one's tool."""

    state: ObjectState
    tool: Float[Array, "B 8"]

    @property
    def x(self) -> Float[Array, "B N 3"]:
        """Particle positions [m]."""
        return self.state.x

    @classmethod
    def at_rest(cls, x: Float[Array, "B N 3"], tool: ToolPose | None = None) -> Self:
        """Objects at rest and undeformed, all with the same tool pose; without one, high over the table."""
        pose = jnp.asarray(PARKED_POSE if tool is None else tool, jnp.float32)
        return cls(State.at_rest(x), jnp.tile(pose, (len(x), 1)))


@final
class ActionDistribution(NamedTuple):
    """Distribution over the next action of B candidates, A numbers each; an action may be a chunk of small moves.

    `spread`: standard deviation about `mean` of each number; 0 if the policy knows no alternative. `later`: the L
    actions that the policy intends after this one, if its chunks span several.
    """

    mean: Float[Array, "B A"]
    spread: Float[Array, "B A"]
    later: Float[Array, "B L A"] | None = None

    @classmethod
    def surely(cls, actions: Float[Array, "B A"]) -> Self:
        """Deterministic actions: no spread."""
        return cls(actions, jnp.zeros_like(actions))


class Policy(Protocol):
    """Proposes the next action. Hashable, so that compiled code can be cached by it."""

    def prepare(self, observed: Points, goal: Points) -> Prepared:
        """Quantities computed once per observation, in NumPy: orderings, matches, embeddings."""
        ...

    def act(self, prepared: Prepared, now: PlanningState) -> ActionDistribution:
        """One action for each candidate; a pure JAX function, called on simulated states as on seen ones."""
        ...


@runtime_checkable
class StatefulPolicy(Protocol):
    """A stateful policy: conditions on the actions that it intended at earlier decisions, if it is given them."""

    def first(self, prepared: Prepared, now: PlanningState) -> ActionDistribution:
        """Action distribution for an observation, with the memory of earlier decisions; rollouts use `act`."""
        ...
