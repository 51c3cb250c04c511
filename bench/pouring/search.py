"""Search of open-loop actions for the reference problem: scripts, their knots by CEM, then every number by descent.

Candidates of all seeds are simulated side by side, in groups of one size, so that one compilation does.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any, Literal, NamedTuple, TypeAlias, final

import jax
import jax.numpy as jnp
import numpy as np
import optax
from jaxtyping import Array, Bool, Float, Float32, Float64, Int

from app.core.geometry.chamfer import chamfer_m2
from bench.pouring.reference import ACTION_UNITS, STEPS, TARGET_M, Outcome, Problem, inside, over_rim_m, poured, reward

Knots: TypeAlias = Float64[np.ndarray, "C K 5"]
"""Shifts along x and z [m] and turns about x, y and z [rad] in each of K equal parts of the episode."""
Objective: TypeAlias = Literal["goal", "rim"]
"""Objective: the reference's reward, or water raised to the held bowl's rim, or over it."""

COLUMNS = (0, 2, 3, 4, 5)
"""Columns of an action that knots describe; translation along y has no effect."""
_SCRIPTS_LOW = np.array([0.25, 0.0, 0.15, 0.6, -0.04, 0.0, -0.02])
_SCRIPTS_HIGH = np.array([0.65, 0.55, 0.6, 2.6, 0.16, 0.6, 0.02])
"""Bounds of the parameters of `scripted`."""
_SPREAD = np.array([0.006, 0.006, 0.12, 0.03, 0.03])
"""Standard deviation of a knot in the first generation [m, rad], or half of its bound."""
_FORGETTING = 0.7
"""The share of a generation's spread that is its elite's."""
_FIRST_STEP = 0.02
"""First step of gradient descent, in bounds."""


@final
@dataclass(frozen=True, kw_only=True)
class Budget:
    """Budget of the search.

    Random `scripts` are tried on the first seed, the best few of them on all; then each seed has `generations` of
    `population` candidates, and `gradient_steps`. `width`: candidates simulated at a time.
    """

    scripts: int = 64
    kept_scripts: int = 8
    knots: int = 10
    population: int = 24
    generations: int = 4
    elite: int = 5
    gradient_steps: int = 5
    width: int = 20


@final
class Found(NamedTuple):
    """The best actions for one seed, their outcome, and the best score after each stage."""

    actions: Float32[np.ndarray, "H 6"]
    outcome: Outcome
    stages: tuple[float, float, float]


def scripted(parameters: Float64[np.ndarray, "C 7"], away: Float64[np.ndarray, "2"], parts: int) -> Knots:
    """Pours as knots: carry the bowl to beside the other one, tilt it there, shift it on while it tilts.

    Parameters: the shares of the episode that carrying takes, at which tilting begins and that it takes; its angle
    [rad]; by how much the carrying falls short of the target along z [m]; the share of that made good while tilting;
    how far aside along x [m]. `away`: target less held bowl, along x and z [m].
    """
    edge = np.linspace(0.0, 1.0, parts + 1)
    carry, begin, tilt, angle, short, follow, aside = parameters.T[..., None]
    carried, tilted = _smooth(edge / carry), _smooth((edge - begin) / tilt)
    knots = np.zeros((len(parameters), parts, 5))
    knots[..., 0] = np.diff((away[0] + aside) * carried)
    knots[..., 1] = np.diff((away[1] + short) * carried - follow * short * tilted)
    knots[..., 2] = np.diff(-angle * tilted)
    return knots


def actions_of(knots: Knots, bound: float) -> Float32[np.ndarray, "C H 6"]:
    """Even steps within each part, no number beyond the bound."""
    part = np.arange(STEPS) * knots.shape[1] // STEPS
    steps = np.bincount(part)[part]
    actions = np.zeros((len(knots), STEPS, 6), np.float32)
    actions[..., COLUMNS] = np.clip(ACTION_UNITS * knots[:, part] / steps[:, None], -bound, bound)
    return actions


@final
class Search:
    """The stages, for the first `seeds` of `problem`, with actions within +-`bound`; `say` is told of progress."""

    def __init__(
        self,
        problem: Problem,
        *,
        seeds: int,
        bound: float,
        budget: Budget,
        objective: Objective,
        say: Callable[[str], None],
    ) -> None:
        self._held = problem.held[:seeds]
        self._bound, self._budget, self._say = bound, budget, say
        water, goal = jnp.asarray(problem.water), jnp.asarray(problem.goal)

        def simulated(actions: Float[Array, "B H 6"], held: Float[Array, "B 3"]) -> tuple[Float[Array, " B"], Outcome]:
            x = poured(actions, water, held)
            over = over_rim_m(x, actions, held)
            outcome = Outcome(reward(x, goal), inside(x), chamfer_m2(x, goal[None]), over)
            return (outcome.reward if objective == "goal" else over), outcome

        def slope(
            actions: Float[Array, "B H 6"], held: Float[Array, "B 3"]
        ) -> tuple[Float[Array, "B H 6"], Float[Array, " B"]]:
            def lost(actions: Float[Array, "B H 6"]) -> tuple[Float[Array, ""], Float[Array, " B"]]:
                score, _ = simulated(actions, held)
                return -score.sum(), score

            return jax.grad(lost, has_aux=True)(actions)

        self._simulated, self._slope = jax.jit(simulated), jax.jit(slope)

    def run(self) -> list[Found]:
        """A result a seed."""
        knots, first = self._scripted()
        knots, second = self._evolved(knots)
        actions, third = self._climbed(knots)
        _, outcome = self.outcomes(actions, np.arange(len(actions)))
        return [
            Found(actions[s], Outcome(*(column[s] for column in outcome)), (first[s], second[s], third[s]))
            for s in range(len(actions))
        ]

    def outcomes(
        self, actions: Float32[np.ndarray, "C H 6"], seeds: Int[np.ndarray, " C"]
    ) -> tuple[Float64[np.ndarray, " C"], Outcome]:
        """Score and outcome of actions, each for its seed; the score is -1 where water left the grid."""
        score, outcome = self._in_groups(self._simulated, actions, seeds)
        return np.nan_to_num(score.astype(np.float64), nan=-1.0), outcome

    def _in_groups(self, function: Callable[..., Any], actions: np.ndarray, seeds: np.ndarray) -> Any:
        """`function` of groups of `width` candidates, the last one filled up, one after the other."""
        width, got = self._budget.width, list[Any]()
        for begin in range(0, len(actions), width):
            which = np.arange(begin, begin + width) % len(actions)
            got.append(function(jnp.asarray(actions[which]), jnp.asarray(self._held[seeds[which]])))

        def joined(*columns: jax.Array) -> np.ndarray:
            return np.concatenate([np.asarray(column) for column in columns])[: len(actions)]

        return jax.tree.map(joined, *got)

    def _scripted(self) -> tuple[Knots, Float64[np.ndarray, " S"]]:
        """The best script for each seed, of those that did best on the first."""
        rng, budget = np.random.default_rng(0), self._budget
        scripts = rng.uniform(_SCRIPTS_LOW, _SCRIPTS_HIGH, (budget.scripts, len(_SCRIPTS_LOW)))
        # The reference's z is our -y.
        away = np.stack([TARGET_M[0] - self._held[:, 0], self._held[:, 1] - TARGET_M[1]], axis=1)
        first = self._scores(scripted(scripts, away[0], budget.knots)[None])[0]
        chosen = scripts[np.argsort(-first, kind="stable")[: budget.kept_scripts]]
        knots = np.stack([scripted(chosen, one, budget.knots) for one in away])
        scores = self._scores(knots)
        self._say(f"scripts: {scores.max(axis=1).mean():.4f}")
        return knots[np.arange(len(knots)), scores.argmax(axis=1)], scores.max(axis=1)

    def _scores(self, knots: Float64[np.ndarray, "S C K 5"]) -> Float64[np.ndarray, "S C"]:
        seeds, count = knots.shape[:2]
        actions = actions_of(knots.reshape(-1, *knots.shape[2:]), self._bound)
        return self.outcomes(actions, np.repeat(np.arange(seeds), count))[0].reshape(seeds, count)

    def _evolved(self, knots: Knots) -> tuple[Knots, Float64[np.ndarray, " S"]]:
        """The cross-entropy method (Rubinstein 1999) on the knots, a population a seed; the best ever seen is kept."""
        rng, budget = np.random.default_rng(1), self._budget
        most = self._bound / ACTION_UNITS * STEPS / budget.knots
        mean, spread = knots, np.broadcast_to(np.minimum(_SPREAD, most / 2), knots.shape)
        best, best_score = knots, np.full(len(knots), -np.inf)
        for generation in range(budget.generations):
            noise = rng.standard_normal((len(knots), budget.population, *knots.shape[1:]))
            drawn = mean[:, None] + spread[:, None] * noise
            drawn[:, 0], drawn[:, 1] = mean, best
            scores = self._scores(drawn)
            order = np.argsort(-scores, axis=1, kind="stable")[:, : budget.elite]
            elite = np.take_along_axis(drawn, order[:, :, None, None], axis=1)
            better = scores.max(axis=1) > best_score
            best, best_score = _where(better, elite[:, 0], best), np.maximum(scores.max(axis=1), best_score)
            mean = elite.mean(axis=1)
            spread = (1 - _FORGETTING) * spread + _FORGETTING * elite.std(axis=1)
            self._say(f"generation {generation}: {best_score.mean():.4f}")
        return best, best_score

    def _climbed(self, knots: Knots) -> tuple[Float32[np.ndarray, "S H 6"], Float64[np.ndarray, " S"]]:
        """Adam on every number of the actions; the best iterate is kept, and steps from it halved that were worse."""
        trial = best = actions_of(knots, self._bound)
        best_score, rate = np.full(len(best), -np.inf), np.full(len(best), _FIRST_STEP * self._bound)
        optimiser = optax.chain(optax.clip_by_global_norm(1.0), optax.scale_by_adam(b1=0.8, b2=0.95))
        memory = jax.vmap(optimiser.init)(jnp.asarray(best))
        for step in range(self._budget.gradient_steps):
            gradient, score = self._in_groups(self._slope, trial, np.arange(len(trial)))
            usable = np.isfinite(gradient).all((1, 2)) & np.isfinite(score)
            better = usable & (score > best_score)
            best, best_score = _where(better, trial, best), np.where(better, score, best_score)
            rate = np.where(better, rate, rate / 2)
            update, memory = jax.vmap(optimiser.update)(jnp.asarray(_where(usable, gradient, 0 * trial)), memory)
            trial = np.clip(best - rate[:, None, None] * np.asarray(update), -self._bound, self._bound)
            trial = trial.astype(np.float32)
            self._say(f"descent {step}: {best_score.mean():.4f}")
        return best, best_score


def _where(which: Bool[np.ndarray, " S"], yes: np.ndarray, no: np.ndarray) -> np.ndarray:
    return np.where(which[:, None, None], yes, no)


def _smooth(t: Float64[np.ndarray, "..."]) -> Float64[np.ndarray, "..."]:
    """Smooth step from 0 to 1, without speed at either end."""
    return np.sin(np.pi / 2 * np.clip(t, 0.0, 1.0)) ** 2
