"""What an initial policy is: something that proposes an action for a state, inside a rollout as well."""

from typing import Any, NamedTuple, Protocol, Self, TypeAlias, final, runtime_checkable

import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float

from app.core.motion import pointing_down
from app.core.types import Points, ToolPose
from app.sim.object_state import ObjectState
from app.sim.state import State

Prepared: TypeAlias = Any
"""A pytree of arrays that only the policy which made it understands."""


AWAY = pointing_down(np.array([0.30, 0.0, 0.30]))
"""Where a tool is that begins its next action anywhere: high over the table."""


@final
class Now(NamedTuple):
    """What B candidates act on; a JAX pytree. `tool`: where each has its tool, as poses with openings."""

    state: ObjectState
    tool: Float[Array, "B 8"]

    @property
    def x(self) -> Float[Array, "B N 3"]:
        """Where the particles are [m]."""
        return self.state.x

    @classmethod
    def at_rest(cls, x: Float[Array, "B N 3"], tool: ToolPose | None = None) -> Self:
        """Objects that are unmoving and undeformed, all with the same tool; without one, high over the table."""
        pose = jnp.asarray(AWAY if tool is None else tool, jnp.float32)
        return cls(State.at_rest(x), jnp.tile(pose, (len(x), 1)))


@final
class Acted(NamedTuple):
    """What B candidates do next, A numbers each: one of the task's actions, which may be a chunk of small ones.

    `spread`: how far about `mean` the policy would as well act, one standard deviation of each number; 0 where it
    knows of no other way. `later`: what it means to do after that, L actions of those whose chunks span several.
    """

    mean: Float[Array, "B A"]
    spread: Float[Array, "B A"]
    later: Float[Array, "B L A"] | None = None

    @classmethod
    def surely(cls, actions: Float[Array, "B A"]) -> Self:
        """These, and no others."""
        return cls(actions, jnp.zeros_like(actions))


class Policy(Protocol):
    """Proposes the next action. Hashable, so that what is compiled for it can be cached."""

    def prepare(self, observed: Points, goal: Points) -> Prepared:
        """What is worked out once an observation, in NumPy: orderings, matches, embeddings."""
        ...

    def act(self, prepared: Prepared, now: Now) -> Acted:
        """One action for each candidate; a pure JAX function, called on simulated states as on seen ones."""
        ...


@runtime_checkable
class Remembering(Protocol):
    """A policy that heeds what it meant to do at earlier decisions, where it was told of them."""

    def first(self, prepared: Prepared, now: Now) -> Acted:
        """As `act`, on what is seen; rollouts, which nobody told it of, ask `act`."""
        ...
