"""Updates of a Gaussian over sequences of actions by samples of it that were simulated."""

from dataclasses import dataclass
from typing import NamedTuple, Protocol, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32

from app.planner.search.tree import Rollout


class Gaussian(NamedTuple):
    """Gaussian over a sequence of D actions of A numbers: mean and standard deviation of each number."""

    mean: Float[Array, "D A"]
    spread: Float[Array, "D A"]

    def draw(self, key: Array, count: int) -> Float[Array, "B D A"]:
        """So many sequences."""
        return self.mean + self.spread * jax.random.normal(key, (count, *self.mean.shape))


class Update(Protocol):
    """The next Gaussian; frozen, so that compiled code can be cached by it. Spreads are in shares of `scale`."""

    def __call__(self, rollout: Rollout, before: Gaussian, scale: Float32[np.ndarray, " A"]) -> Gaussian:
        """Gaussian of the samples; the mean stays where none of them is finite and allowed."""
        ...


@final
@dataclass(frozen=True, kw_only=True)
class Elites:
    """Mean and spread of the `count` best samples: the cross-entropy method (Rubinstein 1999).

    The spread is at least `floor`, so that elites which agree too early do not end the search.
    """

    count: int
    floor: float = 0.25

    def __call__(self, rollout: Rollout, before: Gaussian, scale: Float32[np.ndarray, " A"]) -> Gaussian:
        """See `Update`."""
        order = jnp.argsort(rollout.masked_cost)[: self.count]
        usable = jnp.isfinite(rollout.masked_cost[order])
        share = (usable / jnp.maximum(usable.sum(), 1))[:, None, None]
        chosen = jnp.where(usable[:, None, None], rollout.actions[order], 0.0)
        mean = (share * chosen).sum(0)
        spread = jnp.sqrt((share * (chosen - mean) ** 2).sum(0))
        found = Gaussian(mean, jnp.maximum(spread, self.floor * scale))
        return Gaussian(*(jnp.where(usable.any(), new, old) for new, old in zip(found, before, strict=True)))


@final
@dataclass(frozen=True, kw_only=True)
class PathIntegral:
    """Mean of all samples, each weighed by exp(-(S - min S) / lambda) of its cost S, at a constant spread.

    Williams et al. 2017, "Information theoretic MPC for model-based reinforcement learning", equations 26 and 27. As
    tasks differ in what a cost of 1 is, lambda is `temperature` times the standard deviation of the samples' costs.
    """

    temperature: float = 0.1
    spread: float = 0.5

    def __call__(self, rollout: Rollout, before: Gaussian, scale: Float32[np.ndarray, " A"]) -> Gaussian:
        """See `Update`."""
        usable = jnp.isfinite(rollout.masked_cost)
        cost = jnp.where(usable, rollout.masked_cost, 0.0)
        scaled = -cost / jnp.maximum(self.temperature * jnp.std(cost, where=usable), jnp.finfo(cost.dtype).tiny)
        weight = jax.nn.softmax(jnp.where(usable, scaled, -jnp.inf), where=usable)[:, None, None]
        mean = (weight * jnp.where(usable[:, None, None], rollout.actions, 0.0)).sum(0)
        return Gaussian(
            jnp.where(usable.any(), mean, before.mean), jnp.broadcast_to(self.spread * scale, before.spread.shape)
        )
