"""Behaviour cloning from images: the action that was demonstrated, regressed on what was seen (paper, baselines)."""

from dataclasses import dataclass
from typing import ClassVar, final

import jax.numpy as jnp
from jaxtyping import Array, Float, PRNGKeyArray

from app.policy.base import ActionDistribution
from app.policy.learned.base import Chunk, Lessons, NextOnly, Params, Scale, Shown
from app.policy.learned.networks import EncoderMLP, apply_network
from app.policy.learned.sight import PolicyObservation

_LEAST, _MOST = -4.0, 1.0
"""Logarithms of the least and the greatest standard deviation: a demonstration is not exact, and tells something."""


@final
@dataclass(frozen=True, kw_only=True)
class Cloning(NextOnly):
    """A Gaussian over one action, whose mean and standard deviation the network predicts; fitted by likelihood."""

    width: int = 32
    hidden: int = 256
    depth: int = 2

    window: ClassVar[int] = 1

    def begin(self, key: PRNGKeyArray, seen: PolicyObservation, how: Lessons) -> Params:
        """Initial parameters, as flax draws them."""
        return self._network(how.space.chunk).init(key, seen)["params"]

    def loss(self, params: Params, key: PRNGKeyArray, shown: Shown, how: Lessons, scale: Scale) -> Float[Array, ""]:
        """The negative logarithm of the likelihood, for each number of an action."""
        del key
        mean, spread = self._mean_and_spread(params, shown.seen, how.space.chunk)
        return (0.5 * ((scale.to(shown.actions) - mean) / spread) ** 2 + jnp.log(spread)).mean()

    def act(self, params: Params, seen: PolicyObservation, how: Lessons, scale: Scale) -> ActionDistribution:
        """The mean, and the standard deviation."""
        return scale.back(*self._mean_and_spread(params, seen, how.space.chunk))

    def _mean_and_spread(
        self, params: Params, seen: PolicyObservation, chunk: Chunk
    ) -> tuple[Float[Array, "B T K"], Float[Array, "B T K"]]:
        out = apply_network(self._network(chunk), params, seen)
        mean, spread = jnp.split(out.reshape(len(out), 2, *chunk), 2, axis=1)
        return mean[:, 0], jnp.exp(jnp.clip(spread[:, 0], _LEAST, _MOST))

    def _network(self, chunk: Chunk) -> EncoderMLP:
        return EncoderMLP(self.width, self.hidden, self.depth, 2 * chunk[0] * chunk[1])


LEARNER = Cloning()
