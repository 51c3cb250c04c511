"""Descent on all candidates at once: laws of the best iterate, and of what may not happen to the others."""

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.planner.search.cost import Terms
from app.planner.search.optimise import (
    OptimizedRollouts,
    OptimizerConfig,
    Redraws,
    descend,
    descend_from_cheapest,
    redraw,
)
from app.planner.search.tree import Rollout

DESCENT = OptimizerConfig(learning_rate=1.0, clip=1.0, shrink=0.5)
SCALE = np.full(3, 0.1, np.float32)


def rollout(actions: jnp.ndarray, cost: jnp.ndarray, allowed: jnp.ndarray | None = None) -> Rollout:
    count = len(actions)
    still = jnp.zeros((count, 1, 3)) + cost[:, None, None]
    always = jnp.ones(count, bool) if allowed is None else allowed
    terms = Terms(cost, jnp.zeros(count), jnp.zeros(count))
    return Rollout(actions, still, jnp.zeros((count, 2, 0)), still, terms, cost, always)


def bowl(actions: jnp.ndarray) -> Rollout:
    return rollout(actions, ((actions - 1.0) ** 2).sum((1, 2)))


def run(evaluate, start: jnp.ndarray, steps: int = 5) -> OptimizedRollouts:
    return jax.jit(lambda start: descend(evaluate, start, steps=steps, descent=DESCENT, scale=SCALE))(start)


def test_the_cost_after_descent_is_below_the_cost_before_it_on_a_smooth_cost() -> None:
    start = jnp.asarray(np.random.default_rng(0).normal(size=(4, 2, 3)), jnp.float32)
    found = run(bowl, start)
    assert np.all(found.best.cost < found.cost_before)
    assert np.all(found.finite)


def test_more_steps_get_to_the_minimum() -> None:
    found = run(bowl, jnp.zeros((1, 1, 3)), steps=60)
    np.testing.assert_allclose(found.best.actions, 1.0, atol=0.02)


def test_one_simulation_more_than_steps_is_counted_and_the_first_is_the_start() -> None:
    start = jnp.zeros((2, 1, 3))
    found = run(bowl, start, steps=5)
    assert found.iterates.shape == (6, 2)
    np.testing.assert_allclose(found.iterates[0], bowl(start).cost)
    np.testing.assert_allclose(found.iterates.min(0), found.best.cost)


def test_candidates_do_not_hear_of_each_other() -> None:
    start = jnp.asarray(np.random.default_rng(1).normal(size=(3, 1, 3)), jnp.float32)
    together = run(bowl, start)
    alone = run(bowl, start[1:2])
    np.testing.assert_allclose(together.best.actions[1:2], alone.best.actions, rtol=1e-6)


def test_a_candidate_that_is_not_finite_says_so_and_leaves_the_others_alone() -> None:
    def partly_broken(actions: jnp.ndarray) -> Rollout:
        cost = bowl(actions).cost
        return rollout(actions, jnp.where(jnp.arange(len(actions)) == 0, jnp.nan, cost))

    start = jnp.zeros((2, 1, 3))
    found = run(partly_broken, start)
    assert found.finite.tolist() == [False, True]
    assert found.best.cost[1] < found.cost_before[1]


def test_an_iterate_that_is_not_finite_or_not_allowed_is_never_the_best() -> None:
    def walled(actions: jnp.ndarray) -> Rollout:
        x = actions[:, 0, 0]
        cost = jnp.where(x > 0.5, jnp.nan, bowl(actions).cost)
        return rollout(actions, cost, allowed=x < 0.3)

    found = run(walled, jnp.zeros((1, 1, 3)), steps=12)
    assert found.finite[0]
    assert found.best.allowed[0]
    assert 0.0 < found.best.actions[0, 0, 0] < 0.3


def test_a_gradient_that_is_not_finite_moves_nothing_and_is_counted() -> None:
    def cusp(actions: jnp.ndarray) -> Rollout:
        return rollout(actions, jnp.sqrt(jnp.abs(actions)).sum((1, 2)))

    start = jnp.zeros((1, 1, 3))
    found = run(cusp, start, steps=3)
    np.testing.assert_array_equal(found.best.actions, start)
    assert found.lost_gradients[0] == 3


@pytest.mark.parametrize("factor", [1e-6, 1e6])
def test_the_scale_of_the_cost_does_not_matter(factor: float) -> None:
    start = jnp.zeros((1, 1, 3))
    scaled = run(lambda a: rollout(a, factor * bowl(a).cost), start)
    assert scaled.best.cost[0] / factor < 0.8 * bowl(start).cost[0]


def from_cheapest(evaluate, start: jnp.ndarray, count: int, steps: int = 5) -> OptimizedRollouts:
    def run(start: jnp.ndarray) -> OptimizedRollouts:
        sampled = evaluate(start)
        return descend_from_cheapest(evaluate, sampled, count=count, steps=steps, descent=DESCENT, scale=SCALE)[0]

    return jax.jit(run)(start)


def test_the_cheapest_descend_as_if_they_were_alone_and_the_others_stay_as_they_are() -> None:
    start = jnp.asarray(np.random.default_rng(2).normal(size=(5, 2, 3)), jnp.float32)
    cost = np.asarray(bowl(start).cost)
    cheapest, others = np.argsort(cost)[:2], np.argsort(cost)[2:]
    found, alone = from_cheapest(bowl, start, 2), run(bowl, start[cheapest])
    for mine, its in zip(jax.tree.leaves(found.best), jax.tree.leaves(alone.best), strict=True):
        np.testing.assert_allclose(mine[cheapest], its, rtol=1e-5, atol=1e-6)
    np.testing.assert_allclose(found.iterates[:, cheapest], alone.iterates, rtol=1e-5)
    np.testing.assert_array_equal(found.best.actions[others], start[others])
    np.testing.assert_allclose(found.iterates[:, others], np.tile(cost[others], (6, 1)), rtol=1e-6)
    np.testing.assert_allclose(found.cost_before, cost, rtol=1e-6)
    assert found.finite.all()
    assert not found.lost_gradients.any()


def test_what_may_not_be_made_or_is_not_finite_is_not_among_the_cheapest() -> None:
    def partly_broken(actions: jnp.ndarray) -> Rollout:
        x = actions[:, 0, 0]
        cost = jnp.where(x == 1.0, jnp.nan, bowl(actions).cost)
        return rollout(actions, cost, allowed=x != 0.75)

    start = jnp.zeros((4, 1, 3)).at[:, 0, 0].set(jnp.array([0.75, 1.0, -2.0, 0.25]))
    found = from_cheapest(partly_broken, start, 2)
    moved = np.abs(np.asarray(found.best.actions - start)).max((1, 2)) > 0
    assert moved.tolist() == [False, False, True, True]
    assert found.finite.tolist() == [True, False, True, True]


@pytest.mark.parametrize(("count", "steps"), [(3, 5), (4, 5), (2, 0)])
def test_from_all_of_them_or_without_steps_it_is_descent_itself(count: int, steps: int) -> None:
    start = jnp.asarray(np.random.default_rng(3).normal(size=(3, 1, 3)), jnp.float32)
    found, expected = from_cheapest(bowl, start, count, steps), run(bowl, start, steps)
    for mine, its in zip(jax.tree.leaves(found), jax.tree.leaves(expected), strict=True):
        np.testing.assert_array_equal(mine, its)


def redrawn(evaluate, start: jnp.ndarray, spreads: tuple[float, ...], kept: list[int]) -> Rollout:
    by = Redraws(spreads, np.isin(np.arange(len(start)), kept), jax.random.key(0))
    return redraw(evaluate, evaluate(start), by, scale=SCALE)


def ripples(actions: jnp.ndarray) -> Rollout:
    """A bowl with so many hollows that slopes lead nowhere."""
    return rollout(actions, bowl(actions).cost + (1 - jnp.cos(40 * actions)).sum((1, 2)))


def some(seed: int, count: int = 32) -> jnp.ndarray:
    return jnp.asarray(np.random.default_rng(seed).normal(size=(count, 1, 3)), jnp.float32)


@pytest.mark.parametrize("evaluate", [bowl, ripples])
def test_what_is_drawn_anew_costs_less_rank_by_rank_and_what_is_kept_stays(evaluate) -> None:
    start, ends = some(3), jnp.array([0, 31])
    before, found = evaluate(start), redrawn(evaluate, start, (4.0, 2.0), [0, 31])
    np.testing.assert_array_equal(found.actions[ends], start[ends])
    assert (np.sort(found.cost[1:31]) <= np.sort(before.cost[1:31]) + 1e-6).all()
    assert found.cost.min() < 0.7 * before.cost.min()
    np.testing.assert_allclose(evaluate(found.actions).cost, found.cost, rtol=1e-5)


@pytest.mark.parametrize("spread", [0.5, 4.0])
def test_new_ones_are_drawn_about_the_cheapest_eighth_by_the_spread(spread: float) -> None:
    start, asked = some(4), list[np.ndarray]()

    def recorded(actions: jnp.ndarray) -> Rollout:
        asked.append(np.asarray(actions))
        return bowl(actions)

    redrawn(recorded, start, (spread,), [])
    first, new = asked
    parents = first[np.argsort(np.asarray(bowl(start).cost))[:4]]
    away = (new - np.tile(parents, (8, 1, 1))) / (spread * SCALE)
    assert 0.7 < away.std() < 1.3
    assert np.abs(away).max() < 5


def test_nothing_is_drawn_about_what_may_not_be_made_however_cheap_it_is() -> None:
    start, asked = some(5), list[np.ndarray]()
    far = start.at[:8].set(start[:8] + 50.0)

    def walled(actions: jnp.ndarray) -> Rollout:
        asked.append(np.asarray(actions))
        x = actions[:, 0, 0]
        return rollout(actions, jnp.where(x > 20, -1.0, bowl(actions).cost), allowed=x < 20)

    found = redrawn(walled, far, (2.0,), [])
    assert asked[1].max() < 20
    assert np.isfinite(found.masked_cost).all()


def test_what_is_best_already_is_not_given_up_for_what_is_drawn_anew() -> None:
    start = jnp.ones((16, 1, 3)) + 1e-3 * some(6, 16)
    found = redrawn(bowl, start, (50.0,), [])
    np.testing.assert_allclose(np.sort(found.cost), np.sort(bowl(start).cost), rtol=1e-5)


def test_descent_begins_from_the_cheapest_of_what_was_drawn_anew() -> None:
    start = some(7, 16)
    by = Redraws((3.0,), np.arange(16) == 0, jax.random.key(1))
    anew = redraw(bowl, bowl(start), by, scale=SCALE)
    found, changed = descend_from_cheapest(
        bowl, bowl(start), count=2, steps=3, descent=DESCENT, scale=SCALE, redraws=by
    )
    assert changed.tolist() == list(range(16))
    moved = np.abs(np.asarray(found.best.actions - anew.actions)).max((1, 2)) > 0
    assert sorted(np.flatnonzero(moved)) == sorted(np.argsort(anew.cost)[:2])
    np.testing.assert_allclose(found.cost_before, anew.cost, rtol=1e-6)
    assert found.best.cost.min() < anew.cost.min()


def test_what_was_sampled_is_kept_where_every_iterate_is_simulated_to_cost_more() -> None:
    start = some(8, 6)
    sampled = bowl(start)

    def dearer(actions: jnp.ndarray) -> Rollout:
        return rollout(actions, bowl(actions).cost + 100.0)

    found, changed = descend_from_cheapest(dearer, sampled, count=2, steps=3, descent=DESCENT, scale=SCALE)
    assert sorted(changed.tolist()) == sorted(np.argsort(sampled.cost)[:2].tolist())
    for mine, its in zip(jax.tree.leaves(found.best), jax.tree.leaves(sampled), strict=True):
        np.testing.assert_array_equal(mine, its)
    np.testing.assert_array_equal(found.cost_before, sampled.cost)
    assert found.iterates[:, changed].min() > 50


def test_without_steps_everything_stays_as_it_was_sampled() -> None:
    sampled = bowl(some(9, 4))
    found, changed = descend_from_cheapest(bowl, sampled, count=2, steps=0, descent=DESCENT, scale=SCALE)
    assert not len(changed)
    np.testing.assert_array_equal(found.best.cost, sampled.cost)
