"""Planning by samples of a Gaussian over sequences of actions, which is updated by them again and again."""

from collections.abc import Callable
from dataclasses import dataclass, replace
from functools import partial
from math import ceil
from typing import NamedTuple, Self, final

import jax
import jax.numpy as jnp
import numpy as np
from jaxtyping import Array, Float, Float32, Int, PRNGKeyArray

from app.core.messages import Origin
from app.core.types import Points
from app.planner.search.budget import SampleBudget
from app.planner.search.optimise import OptimizedRollouts, OptimizerConfig, descend
from app.planner.search.plan import Plan, choose
from app.planner.search.request import PlanRequest
from app.planner.search.rollout_frames import resimulate
from app.planner.search.tree import Rollout, RootBatch, TreeConfig, first_of, random_key, simulate, start
from app.planner.search.updates import Gaussian, Update
from app.policy.base import PlanningState

Improve = Callable[[Float[Array, "B D A"]], OptimizedRollouts]
"""Simulates the samples of a generation, and may move each of them downhill."""

_CONTINUED = 0.5
"""Share of the first samples that is about the remainder of the plan before; the others are drawn anew."""


@final
@dataclass(frozen=True, kw_only=True)
class SampleSchedule:
    """Generations of samples.

    A first one drawn at random is followed by others from the Gaussian that `update` makes of the one before, up to
    `generations`. The `kept` best of all generations are the branches of the plan. Where the plan before has left a
    remainder, `continued` of the first ones are it, and others from a Gaussian of `spread` [scale] about it.
    """

    generations: int
    kept: int
    update: Update
    continued: int = 0
    spread: float = 0.5


@final
@dataclass(frozen=True, kw_only=True)
class SamplingPlanner:
    """Samples, simulates, updates, again and again; then executes the first action of the best sequence of all.

    The population is the `search`'s branches, and it is not guided: no policy has a say. With `gradient_steps` every
    sample is descended from before the Gaussian is updated (Bharadhwaj et al. 2020, "Model-predictive control via
    cross-entropy and gradient-based optimization", algorithm 1).
    """

    search: TreeConfig
    schedule: SampleSchedule
    descent: OptimizerConfig
    gradient_steps: int = 0

    @classmethod
    def of(
        cls, search: TreeConfig, size: SampleBudget, update: Update, descent: OptimizerConfig, gradient_steps: int = 0
    ) -> Self:
        """The planner of such a budget, which keeps as many branches as the tree has."""
        return cls(
            search=replace(search, branches=size.population, guided=False),
            schedule=SampleSchedule(
                generations=size.generations,
                kept=min(search.branches, size.population),
                update=update,
                continued=ceil(size.population * _CONTINUED),
            ),
            descent=descent,
            gradient_steps=gradient_steps,
        )

    def __call__(self, request: PlanRequest) -> Plan:
        """See `app.planner.base.Planner`. Of a branch, the cost before is that of its rank as first sampled."""
        begun = self.shift(start(self.search, request), request)
        found = _evolve(self, begun, jnp.asarray(request.goal), random_key(request.seed))
        origins: list[Origin] = ["sampled"] * self.schedule.kept
        kept, goal = _first(begun, self.schedule.kept), jnp.asarray(request.goal)
        seen = resimulate(self.search, *kept, goal, found.best.actions).moments
        descended = jax.device_get(found)
        return choose(self.search, descended, origins, request, seen=seen.ending_in(descended.best.final))

    def compile(self, example: Points, phi: Float32[np.ndarray, " P"]) -> None:
        """Compile for states and goals of the size of `example` (N, 3); simulates nothing."""
        begun = start(self.search, PlanRequest(observed=example, goal=example, phi=phi))
        goal, kept = jnp.asarray(example), self.schedule.kept
        _evolve.lower(self, begun, goal, random_key(0)).compile()
        actions = jnp.zeros((kept, self.search.depth, self.search.space.size))
        resimulate.lower(self.search, *_first(begun, kept), goal, actions).compile()

    def shift(self, begun: RootBatch, request: PlanRequest) -> RootBatch:
        """Draw some of the first samples about the remainder of the plan before; the last is that itself."""
        others, rest = self.schedule.continued - 1, request.remainder
        if rest is None or others < 1:
            return begun
        first, later, steps = np.array(begun.first), np.array(begun.later), min(len(rest), self.search.depth)
        noise = np.random.default_rng([request.seed, 2]).standard_normal((others, steps, self.search.space.size))
        about = rest[:steps] + self.schedule.spread * self.search.space.scale() * noise
        first[-1 - others : -1], later[-1 - others : -1, : steps - 1] = about[:, 0], about[:, 1:]
        return begun._replace(first=jnp.asarray(first), later=jnp.asarray(later))


def _first(begun: RootBatch, count: int) -> tuple[Float[Array, "K P"], PlanningState]:
    """Model and situation of so many branches."""
    return first_of((begun.phi, begun.now), count)


@partial(jax.jit, static_argnums=0)
def _evolve(
    planner: SamplingPlanner, begun: RootBatch, goal: Float[Array, "M 3"], key: PRNGKeyArray
) -> OptimizedRollouts:
    search, scale = planner.search, planner.search.space.scale()
    improve = partial(
        descend,
        partial(simulate, search, begun.phi, begun.now, goal),
        steps=planner.gradient_steps,
        descent=planner.descent,
        scale=scale,
    )
    first = jnp.concatenate([begun.first[:, None], begun.later], axis=1)
    return evolve(improve, first, key, schedule=planner.schedule, scale=scale)


class _Kept(NamedTuple):
    """The best of all generations so far, the cheapest first; infeasible or non-finite ones cost infinity."""

    rollout: Rollout
    lost: Int[Array, " K"]
    cost: Float[Array, " K"]

    def with_those(self, found: OptimizedRollouts) -> "_Kept":
        """The best of these and of a generation."""
        new = _Kept(found.best, found.lost_gradients, found.best.masked_cost)
        order = jnp.argsort(jnp.concatenate([new.cost, self.cost]))[: len(self.cost)]

        def merged(a: Array, b: Array) -> Array:
            return jnp.concatenate([a, b])[order]

        return jax.tree.map(merged, new, self)


class _Generation(NamedTuple):
    """Candidates to evaluate next, the distribution they were drawn from, and the best so far."""

    actions: Float[Array, "B D A"]
    drawn: Gaussian
    kept: _Kept


def evolve(
    improve: Improve,
    first: Float[Array, "B D A"],
    key: PRNGKeyArray,
    *,
    schedule: SampleSchedule,
    scale: Float32[np.ndarray, " A"],
) -> OptimizedRollouts:
    """The best `schedule.kept` sequences of all generations, the cheapest first, of which `first` is the first.

    `cost_before` and `iterates` are by rank: the cost of the first generation as it was sampled, and those of every
    generation by itself. By construction no rank costs more than before.
    """

    def step(now: _Generation, key: PRNGKeyArray) -> tuple[_Generation, tuple[Array, Array]]:
        found = improve(now.actions)
        before = jnp.where(jnp.isfinite(found.best.masked_cost), found.cost_before, jnp.inf)
        costs = (jnp.sort(before)[: schedule.kept], jnp.sort(found.best.masked_cost)[: schedule.kept])
        updated = schedule.update(found.best, now.drawn, scale)
        return _Generation(updated.draw(key, len(first)), updated, now.kept.with_those(found)), costs

    begin = _Generation(first, Gaussian(first.mean(0), first.std(0)), _none(improve, first, schedule.kept))
    end, (before, after) = jax.lax.scan(step, begin, jax.random.split(key, schedule.generations))
    best = end.kept.rollout
    return OptimizedRollouts(best, _mask_unused_ranks(before[0]), _mask_unused_ranks(after), end.kept.lost, best.finite)


def _none(improve: Improve, first: Float[Array, "B D A"], kept: int) -> _Kept:
    """Empty `_Kept`, in its final shapes."""
    shapes = jax.eval_shape(improve, first)

    def empty(a: jax.ShapeDtypeStruct) -> Array:
        return jnp.zeros((kept, *a.shape[1:]), a.dtype)

    return _Kept(jax.tree.map(empty, shapes.best), empty(shapes.lost_gradients), jnp.full(kept, jnp.inf))


def _mask_unused_ranks(costs: Float[Array, "*axes"]) -> Float[Array, "*axes"]:
    """The costs, NaN for a rank that nothing took."""
    return jnp.where(jnp.isfinite(costs), costs, jnp.nan)
