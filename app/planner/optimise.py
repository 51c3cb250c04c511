"""Gradient descent on the actions of all branches at once."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, TypeVar, cast, final

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Float32, Int

from app.planner.tree import Rollout

TreeT = TypeVar("TreeT")

Evaluate = Callable[[Float[Array, "B D A"]], Rollout]
"""A differentiable simulation of all candidates; the cost of each depends on its own actions alone."""


@final
@dataclass(frozen=True, kw_only=True)
class Descent:
    """Settings of gradient descent; steps are in units of the action space's scale.

    Each candidate's gradient is clipped to `clip` on its own, so that one which explodes through a contact does not
    drown the others, and each has its own Adam state and step size. A step that did not lower a candidate's cost is
    taken back, and its next one is `shrink` times as long.
    """

    learning_rate: float
    clip: float
    shrink: float

    def optimiser(self) -> optax.GradientTransformation:
        """Optimiser of one candidate; the caller maps it over all."""
        return optax.chain(optax.clip_by_global_norm(self.clip), optax.scale_by_adam(b1=0.7, b2=0.9))


class Descended(NamedTuple):
    """Each candidate's best iterate, and how it got there.

    `best.cost <= cost_before` by construction, as the first iterate is a candidate for the best. `iterates` holds the
    cost of every iterate tried, better or not: the honest companion. `lost_gradients`: how often a candidate's
    gradient was not finite, so that it could not move; `finite`: whether the best iterate is.
    """

    best: Rollout
    cost_before: Float[Array, " B"]
    iterates: Float[Array, "G B"]
    lost_gradients: Int[Array, " B"]
    finite: Bool[Array, " B"]


class _Climber(NamedTuple):
    best: Rollout
    gradient: Float[Array, "B D A"]
    memory: Any
    rate: Float[Array, " B"]
    lost: Int[Array, " B"]


def descend(
    evaluate: Evaluate,
    actions: Float[Array, "B D A"],
    *,
    steps: int,
    descent: Descent,
    scale: Float32[np.ndarray, " A"],
) -> Descended:
    """`steps` gradient steps from `actions`: steps + 1 simulations, and the gradients of the first `steps` of them.

    Without steps the actions are what they were, simulated once.
    """
    if not steps:
        rollout = evaluate(actions)
        return Descended(rollout, rollout.cost, rollout.cost[None], jnp.zeros(len(actions), jnp.int32), rollout.finite)
    optimiser = descent.optimiser()

    def slope(actions: Float[Array, "B D A"]) -> tuple[Rollout, Float[Array, "B D A"], Bool[Array, " B"]]:
        def summed(actions: Float[Array, "B D A"]) -> tuple[Float[Array, ""], Rollout]:
            rollout = evaluate(actions)
            return rollout.cost.sum(), rollout

        gradient, rollout = jax.grad(summed, has_aux=True)(actions)
        usable = jnp.isfinite(gradient).all((1, 2))
        return rollout, jnp.where(usable[:, None, None], gradient * scale, 0.0), usable

    def propose(climber: _Climber) -> tuple[Float[Array, "B D A"], Any]:
        updates, memory = cast(tuple[Any, Any], jax.vmap(optimiser.update)(climber.gradient, climber.memory))
        return climber.best.actions - climber.rate[:, None, None] * scale * updates, memory

    def step(climber: _Climber, _: None) -> tuple[_Climber, Float[Array, " B"]]:
        trial, memory = propose(climber)
        rollout, gradient, usable = slope(trial)
        better = _better(rollout, climber.best)
        rate = jnp.where(better, climber.rate, climber.rate * descent.shrink)
        moved = _Climber(rollout, gradient, memory, rate, climber.lost)
        return _choose(better, moved, climber._replace(rate=rate))._replace(lost=climber.lost + ~usable), rollout.cost

    first, gradient, usable = slope(actions)
    memory = jax.vmap(optimiser.init)(actions)
    rate = jnp.full(len(actions), descent.learning_rate)
    climber = _Climber(first, gradient, memory, rate, jnp.where(usable, 0, 1))
    climber, costs = jax.lax.scan(step, climber, None, length=steps - 1)
    last = evaluate(propose(climber)[0])
    best = _choose(_better(last, climber.best), last, climber.best)
    iterates = jnp.concatenate([first.cost[None], costs, last.cost[None]])
    return Descended(best, first.cost, iterates, climber.lost, best.finite)


def _better(new: Rollout, old: Rollout) -> Bool[Array, " B"]:
    """True if a candidate's new iterate is allowed, finite and cheaper."""
    return new.allowed & new.finite & (new.cost < old.cost)


def _choose(which: Bool[Array, " B"], yes: TreeT, no: TreeT) -> TreeT:
    """Per candidate, `yes` or `no`, for whole trees of arrays."""

    def pick(a: Array, b: Array) -> Array:
        return jnp.where(which.reshape(-1, *[1] * (a.ndim - 1)), a, b)

    return jax.tree.map(pick, yes, no)
