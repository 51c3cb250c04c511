"""What an initial policy is: something that proposes an action for a state, inside a rollout as well."""

from typing import Any, Protocol, TypeAlias

from jaxtyping import Array, Float

from app.core.types import Points

Prepared: TypeAlias = Any
"""A pytree of arrays that only the policy which made it understands."""


class Policy(Protocol):
    """Proposes the next action. Frozen and hashable, so that what is compiled for it can be cached."""

    def prepare(self, observed: Points, goal: Points) -> Prepared:
        """What is worked out once an observation, in NumPy: orderings, matches, embeddings."""
        ...

    def act(self, prepared: Prepared, x: Float[Array, "B N 3"]) -> Float[Array, "B A"]:
        """One action for each candidate state `x` [m]; a pure JAX function."""
        ...
