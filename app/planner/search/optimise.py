"""Gradient descent on the actions of all branches at once."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, NamedTuple, Self, TypeVar, cast, final

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Float32, Int, PRNGKeyArray

from app.planner.search.tree import Rollout

TreeT = TypeVar("TreeT")

Evaluate = Callable[[Float[Array, "B D A"]], Rollout]
"""A differentiable simulation of candidates, as many as it was made for or fewer; the cost of each depends on its own
actions (in the action space's units) alone. To simulate one more, put it in the place of another."""


@final
@dataclass(frozen=True, kw_only=True)
class OptimizerConfig:
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


_CHILDREN = 8
"""One in so many candidates is one that others are drawn about."""


class OptimizedRollouts(NamedTuple):
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

    @classmethod
    def from_samples(cls, best: Rollout, iterates: Float[Array, "G B"]) -> Self:
        """The best of a method without gradients, with the best cost of each candidate in every generation of it."""
        lost = jnp.zeros(len(best.cost), jnp.int32)
        return cls(best, iterates[0], iterates, lost, best.finite)


Optimise = Callable[[Evaluate, Float[Array, "B D A"], Float32[np.ndarray, " A"]], OptimizedRollouts]
"""A planner's own way to better the actions of all candidates, a pure function that JAX can compile.

It is given their simulation, the first actions in the action space's own units, and that space's scale, by which to
measure a step. The cheapest of what it returns is executed: an average that was not simulated never is. What it draws
at random is the same in every decision; the first actions are not."""


class _Climber(NamedTuple):
    """Best iterates, what the optimiser knows there, and the step to try next."""

    best: Rollout
    gradient: Float[Array, "B D A"]
    memory: Any
    rate: Float[Array, " B"]
    lost: Int[Array, " B"]


class _Trial(NamedTuple):
    """Actions to try, and the optimiser's memory if they are taken."""

    actions: Float[Array, "B D A"]
    memory: Any


def descend(
    evaluate: Evaluate,
    actions: Float[Array, "B D A"],
    *,
    steps: int,
    descent: OptimizerConfig,
    scale: Float32[np.ndarray, " A"],
) -> OptimizedRollouts:
    """`steps` gradient steps from `actions`: steps + 1 simulations, and the gradients of the first `steps` of them.

    Without steps the actions are what they were, simulated once.
    """
    if not steps:
        rollout = evaluate(actions)
        return OptimizedRollouts.from_samples(rollout, rollout.cost[None])
    optimiser = descent.optimiser()

    def slope(actions: Float[Array, "B D A"]) -> tuple[Rollout, Float[Array, "B D A"], Bool[Array, " B"]]:
        def summed(actions: Float[Array, "B D A"]) -> tuple[Float[Array, ""], Rollout]:
            rollout = evaluate(actions)
            return rollout.cost.sum(), rollout

        gradient, rollout = jax.grad(summed, has_aux=True)(actions)
        usable = jnp.isfinite(gradient).all((1, 2))
        return rollout, jnp.where(usable[:, None, None], gradient * scale, 0.0), usable

    def propose(climber: _Climber) -> _Trial:
        updates, memory = cast(tuple[Any, Any], jax.vmap(optimiser.update)(climber.gradient, climber.memory))
        return _Trial(climber.best.actions - climber.rate[:, None, None] * scale * updates, memory)

    # The first iterate is tried as all others are: with one simulation and its adjoint a program is made faster.
    def step(
        carry: tuple[_Climber, _Trial], is_first: Bool[Array, ""]
    ) -> tuple[tuple[_Climber, _Trial], Float[Array, " B"]]:
        climber, trial = carry
        rollout, gradient, usable = slope(trial.actions)
        better = _better(rollout, climber.best) | is_first
        rate = jnp.where(better, climber.rate, climber.rate * descent.shrink)
        moved = _Climber(rollout, gradient, trial.memory, rate, climber.lost)
        climber = select(better, moved, climber._replace(rate=rate))._replace(lost=climber.lost + ~usable)
        return (climber, propose(climber)), rollout.cost

    none = jax.tree.map(jnp.zeros_like, jax.eval_shape(evaluate, actions))
    memory, count = jax.vmap(optimiser.init)(actions), len(actions)
    rate, lost = jnp.full(count, descent.learning_rate), jnp.zeros(count, jnp.int32)
    begun = _Climber(none, jnp.zeros_like(actions), memory, rate, lost), _Trial(actions, memory)
    (climber, trial), costs = jax.lax.scan(step, begun, jnp.arange(steps) == 0)
    last = evaluate(trial.actions)
    best = select(_better(last, climber.best), last, climber.best)
    return OptimizedRollouts(best, costs[0], jnp.concatenate([costs, last.cost[None]]), climber.lost, best.finite)


class Redraws(NamedTuple):
    """A way to draw candidates anew: with each of these `spreads` [scale] in turn, but for those that are `kept`.

    Others may be drawn about these, too, and are then random ones like all.
    """

    spreads: tuple[float, ...]
    kept: Bool[np.ndarray, " B"]
    key: PRNGKeyArray


def redraw(evaluate: Evaluate, found: Rollout, by: Redraws, *, scale: Float32[np.ndarray, " A"]) -> Rollout:
    """The candidates, in place of those that are not kept the cheapest of them and of others, drawn about the cheapest.

    For each spread as many as there are, about an eighth of them, with normal deviations in every number: a random
    search about several places at once, where slopes through contacts lead nowhere.
    """
    count, free = len(found.cost), np.flatnonzero(~by.kept)

    def joined(mine: Array, its: Array) -> Array:
        return jnp.concatenate([mine[free], its])

    for spread, key in zip(by.spreads, jax.random.split(by.key, len(by.spreads)), strict=True):
        parents = jnp.argsort(found.masked_cost)[: max(1, count // _CHILDREN)]
        about = found.actions[jnp.resize(parents, (count,))]
        pool = jax.tree.map(joined, found, evaluate(about + spread * scale * jax.random.normal(key, about.shape)))
        best = jnp.argsort(pool.masked_cost)[: len(free)]

        def replaced(mine: Array, its: Array, best: Int[Array, " F"] = best) -> Array:
            return mine.at[free].set(its[best])

        found = jax.tree.map(replaced, found, pool)
    return found


def descend_from_cheapest(
    evaluate: Evaluate,
    sampled: Rollout,
    *,
    count: int,
    steps: int,
    descent: OptimizerConfig,
    scale: Float32[np.ndarray, " A"],
    redraws: Redraws | None = None,
) -> tuple[OptimizedRollouts, Int[Array, " K"]]:
    """`descend` from the `count` that cost least of what was `sampled`, or once redrawn; the others stay as they are.

    Without steps all of them do. Returns those that may not be as they were sampled, too. What was sampled is better
    than an iterate that costs more, though it was simulated in another way.
    """
    if not steps:
        return OptimizedRollouts.from_samples(sampled, sampled.cost[None]), jnp.arange(0)
    all_ = sampled if redraws is None else redraw(evaluate, sampled, redraws, scale=scale)
    chosen = jnp.argsort(all_.masked_cost)[:count]

    def drawn(mine: Array) -> Array:
        return mine[chosen]

    here = jax.tree.map(drawn, all_)
    found = descend(evaluate, here.actions, steps=steps, descent=descent, scale=scale)
    better = select(_better(found.best, here), found.best, here)

    def placed(mine: Array, its: Array) -> Array:
        return mine.at[chosen].set(its)

    best = jax.tree.map(placed, all_, better)
    bettered = OptimizedRollouts(
        best=best,
        cost_before=all_.cost,
        iterates=jnp.tile(all_.cost, (len(found.iterates), 1)).at[:, chosen].set(found.iterates),
        lost_gradients=jnp.zeros(len(all_.cost), jnp.int32).at[chosen].set(found.lost_gradients),
        finite=best.finite,
    )
    return bettered, chosen if redraws is None else jnp.arange(len(all_.cost))


def _better(new: Rollout, old: Rollout) -> Bool[Array, " B"]:
    """True if a candidate's new iterate is allowed, finite and cheaper."""
    return new.allowed & new.finite & (new.cost < old.cost)


def select(which: Bool[Array, " B"], yes: TreeT, no: TreeT) -> TreeT:
    """Per candidate, `yes` or `no`, for whole trees of arrays."""

    def pick(a: Array, b: Array) -> Array:
        return jnp.where(which.reshape(-1, *[1] * (a.ndim - 1)), a, b)

    return jax.tree.map(pick, yes, no)
