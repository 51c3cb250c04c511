"""Planners that are compared: each betters its draws, and simulates no less than the tree without a policy."""

import math
from dataclasses import replace

import jax
import jax.numpy as jnp
import numpy as np
import pytest
from jaxtyping import Array, Float

from app.core.errors import UsageError
from app.planner.base import Planner
from app.planner.method import ABLATIONS, PAPER, Method, planners
from app.planner.planner_factory import make_planner
from app.planner.search.budget import SLOPE_ROLLOUTS, tree_rollouts
from app.planner.search.cost import Terms
from app.planner.search.optimise import OptimizedRollouts, OptimizerConfig, descend
from app.planner.search.plan import TreePlanner
from app.planner.search.request import PlanRequest
from app.planner.search.sampling import SampleSchedule, SamplingPlanner, evolve
from app.planner.search.tree import Rollout, start
from app.planner.search.updates import Elites, Gaussian, PathIntegral, Update
from app.policy.base import PlanningState, Prepared
from app.sim.diagnosis.object_state import ObjectState
from app.tasks import load, names
from tests.planner.table import PHI, TASK, rope, search

BASELINES = sorted(set(planners()) - {PAPER})
DESCENT = OptimizerConfig(learning_rate=1.0, clip=1.0, shrink=0.5)


def simulated(planner: Planner) -> int:
    """Number of rollouts of one decision, counted from the planner's settings and not from its budget.

    Of a planner that has its own way to better branches, one rollout of each for every cost that it tells of them.
    """
    assert isinstance(planner, TreePlanner | SamplingPlanner)
    if isinstance(planner, TreePlanner):
        if planner.optimise is not None:
            optimise, actions = planner.optimise, jnp.zeros((planner.search.branches, 1, 2))
            found = jax.eval_shape(lambda: optimise(bowl, actions, np.ones(2, np.float32)))
            return len(found.iterates) * planner.search.branches
        return planner.search.branches * SLOPE_ROLLOUTS * planner.gradient_steps
    samples = planner.schedule.generations * planner.search.branches
    return samples * (1 + SLOPE_ROLLOUTS * planner.gradient_steps)


@pytest.mark.parametrize("baseline", BASELINES)
@pytest.mark.parametrize("task", names())
def test_a_baseline_simulates_at_least_as_much_as_the_tree_and_at_most_three_times(task: str, baseline: str) -> None:
    for name in ("cpu", "gpu"):
        preset = load(task).preset(name)
        sized = replace(
            search(),
            branches=preset.branches,
            depth=preset.depth,
            descended=preset.descended,
            redraws=preset.redraws,
            policy_shares=preset.policy_shares,
        )
        baseline_planner = make_planner(Method(planner=baseline), sized, DESCENT, preset.gradient_steps)
        tree = tree_rollouts(sized, preset.gradient_steps)
        assert tree <= simulated(baseline_planner) <= 3 * tree  # A population has a least size, however small the tree.


def test_a_tree_simulates_what_its_budget_says() -> None:
    steps, counted = 2, list[int]()
    sized = replace(search(branches=4), descended=1)

    def counting(phi: Array, state: ObjectState, path: Array) -> ObjectState:
        jax.debug.callback(counted.append, len(phi))
        return state

    tree = make_planner(Method(), replace(sized, advance=counting), DESCENT, steps)
    assert isinstance(tree, TreePlanner)
    tree(PlanRequest(observed=rope(), goal=rope(0.04), phi=PHI))
    jax.effects_barrier()
    grown, slopes = 4 * sized.depth, 1 * sized.depth
    assert sum(counted) == grown + (steps + 1) * slopes
    assert tree_rollouts(sized, steps) == 4 + 1 + SLOPE_ROLLOUTS * steps
    assert tree_rollouts(sized, 0) == 4


@pytest.mark.parametrize("name", planners())
def test_a_decision_is_finite_and_better_than_its_first_samples(name: str) -> None:
    asked = PlanRequest(observed=rope(), goal=rope(0.04, 0.3), phi=PHI)
    plan = make_planner(Method(planner=name), search(), TASK.descent, 2)(asked)
    before, after = zip(*((branch.cost_before, branch.cost_after) for branch in plan.branches), strict=True)
    assert np.isfinite(plan.motion.positions).all()
    assert min(after) <= np.nanmin(before)
    assert sum(after) < np.nansum(before)
    assert plan.branches[plan.best].cost_after == min(after)


class Forbidden:
    """A policy that must not be asked."""

    def prepare(self, observed: np.ndarray, goal: np.ndarray) -> Prepared:
        raise AssertionError("the policy was asked to prepare")

    def act(self, prepared: Prepared, now: PlanningState) -> Float[Array, "B A"]:
        raise AssertionError("the policy was asked to act")


@pytest.mark.parametrize("method", [*map(Method.of, BASELINES), Method.of(ablation="no_policy")])
def test_who_plans_without_policy_does_not_ask_it(method: Method) -> None:
    planner = make_planner(method, replace(search(), policy=Forbidden()), DESCENT, 1)
    assert isinstance(planner, TreePlanner | SamplingPlanner)
    tree = start(planner.search, PlanRequest(observed=rope(), goal=rope(0.05), phi=PHI))
    assert tree.first.shape == (planner.search.branches, TASK.actions.size)
    assert tree.later.shape[1] == planner.search.depth - 1
    assert len(np.unique(np.asarray(tree.first), axis=0)) == planner.search.branches


def test_an_ablation_leaves_out_what_it_says() -> None:
    whole, *others = (
        make_planner(Method.of(ablation=name), search(), DESCENT, 3)
        for name in (None, "no_optimisation", "no_planning")
    )
    assert isinstance(whole, TreePlanner)
    for planner in others:
        assert isinstance(planner, TreePlanner)
        assert planner.gradient_steps == 0
    assert [planner.search.branches for planner in (whole, *others)] == [4, 4, 1]


@pytest.mark.parametrize("options", [{"guided": False, "branching": False}, {"planner": "cem_mpc", "guided": False}])
def test_methods_that_make_no_sense_are_refused(options: dict[str, object]) -> None:
    with pytest.raises(UsageError, match=r"policy|parts to leave out"):
        Method(**options)  # pyright: ignore[reportArgumentType]
    assert set(ABLATIONS) >= {"no_calibration", "no_optimisation", "no_planning", "no_policy"}


def bowl(actions: Float[Array, "B D A"]) -> Rollout:
    """Rollout whose cost is the squared distance from 1; not finite below -0.5, and not allowed above 2."""
    cost = jnp.where((actions < -0.5).any((1, 2)), jnp.nan, ((actions - 1.0) ** 2).sum((1, 2)))
    points = jnp.zeros((len(actions), 1, 3))
    terms = Terms(cost, *jnp.zeros((2, len(cost))))
    none = jnp.zeros((len(actions), 2, 0))
    return Rollout(actions, points, none, points, terms, cost, (actions < 2.0).all((1, 2)))


@pytest.mark.parametrize("steps", [0, 1])
@pytest.mark.parametrize("update", [Elites(count=8), PathIntegral(spread=4.0)], ids=["elites", "path_integral"])
def test_samples_find_a_minimum_among_what_is_finite_and_allowed(update: Update, steps: int) -> None:
    scale = np.full(2, 0.05, np.float32)

    def improve(actions: Float[Array, "B D A"]) -> OptimizedRollouts:
        return descend(bowl, actions, steps=steps, descent=DESCENT, scale=scale)

    first = 2.0 * jax.random.normal(jax.random.key(1), (64, 2, 2))
    schedule = SampleSchedule(generations=12, kept=5, update=update)
    found = evolve(improve, first, jax.random.key(2), schedule=schedule, scale=scale)
    assert math.isfinite(float(found.best.cost[0]))
    assert float(found.best.cost[0]) < 0.01 < float(jnp.nanmin(found.cost_before))
    assert (np.diff(np.asarray(found.best.cost)) >= 0).all()
    assert (np.asarray(found.best.actions) < 2.0).all()
    assert (np.asarray(found.best.actions) > -0.5).all()


SCALE = np.array([0.1, 0.2], np.float32)
BEFORE = Gaussian(jnp.array([[0.3, 0.4]]), jnp.array([[1.0, 1.0]]))


def test_a_path_integral_weighs_samples_by_the_exponential_of_their_cost() -> None:
    actions = jnp.array([[[0.5, 0.5]], [[1.0, 1.5]], [[0.0, 3.0]]])  # The last may not be made.
    cost = np.array([0.5, 0.25])
    found = PathIntegral(temperature=0.5, spread=0.25)(bowl(actions), BEFORE, SCALE)
    weight = np.exp(-cost / (0.5 * cost.std()))
    assert found.mean == pytest.approx(np.average(actions[:2], axis=0, weights=weight), rel=1e-5)
    assert found.spread == pytest.approx(0.25 * SCALE[None])


@pytest.mark.parametrize("update", [Elites(count=2), PathIntegral()], ids=["elites", "path_integral"])
def test_a_mean_stays_where_no_sample_may_be_made(update: Update) -> None:
    assert (update(bowl(jnp.full((3, 1, 2), 3.0)), BEFORE, SCALE).mean == BEFORE.mean).all()


def test_samples_of_one_cost_are_averaged() -> None:
    actions = jnp.array([[[0.5, 1.0]], [[1.5, 1.0]]])
    assert PathIntegral()(bowl(actions), BEFORE, SCALE).mean == pytest.approx(np.array([[1.0, 1.0]]))


def test_a_tree_draws_random_branches_anew_and_keeps_the_policys_and_one_branch_never_does() -> None:
    asked = PlanRequest(observed=rope(), goal=rope(0.04, 0.3), phi=PHI, seed=1)
    sized = replace(search(branches=8, depth=1), descended=1, redraws=(2.0,))
    plain, anew = (
        make_planner(Method(), replace(sized, redraws=redraws), DESCENT, 1)(asked) for redraws in ((), (2.0,))
    )
    assert anew.branches[0].origin == "policy"
    assert anew.branches[0].cost_before == pytest.approx(plain.branches[0].cost_before, rel=1e-4)
    before = [sorted(branch.cost_before for branch in plan.branches[1:]) for plan in (anew, plain)]
    assert all(mine <= its + 1e-9 for mine, its in zip(*before, strict=True))
    assert before[0] != before[1]
    for method in (Method.of("diff_mpc"), Method.of(ablation="no_planning")):
        single = make_planner(method, sized, DESCENT, 1)
        assert isinstance(single, TreePlanner)
        assert (single.search.branches, single.search.redraws) == (1, ())
