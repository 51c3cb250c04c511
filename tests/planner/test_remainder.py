"""Plans that start from what is left of the one before: where the world does as predicted, nothing is lost."""

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.core.messages import Branch
from app.jobs import jit_cache, worker_api
from app.planner.method import Method, planners
from app.planner.planner_factory import make_planner
from app.planner.search.plan import Plan, TreePlanner
from app.planner.search.request import PlanRequest, remainder_of
from app.planner.search.rollout_frames import grow
from app.planner.search.sampling import SamplingPlanner
from app.planner.search.tree import RootBatch, simulate, start
from app.policy.base import PARKED_POSE as POSE
from app.tasks import load, names
from tests.planner.table import PHI, SPACE, TASK, planner, rope, search

DEPTH = 3
ASKED = PlanRequest(observed=rope(), goal=rope(0.05, 0.2), phi=PHI, seed=1)


def whole(name: str, depth: int = DEPTH) -> TreePlanner | SamplingPlanner:
    made = make_planner(Method(planner=name), search(depth=depth), TASK.descent, 1)
    assert isinstance(made, TreePlanner | SamplingPlanner)
    return made


def chosen(plan: Plan) -> Branch:
    return plan.branches[plan.best]


def next_request(plan: Plan) -> PlanRequest:
    """The next decision in a world that does as the plan predicts."""
    then = replace(ASKED, observed=plan.predicted, seed=2)
    return replace(then, remainder=remainder_of(chosen(plan), ASKED.observed, then.observed))


def last(tree: RootBatch) -> RootBatch:
    """Its last branch alone."""
    return jax.tree.map(lambda leaf: leaf[-1:], tree._replace(prepared=None))._replace(prepared=tree.prepared)


@pytest.mark.parametrize("name", planners())
def test_where_the_world_does_as_predicted_no_plan_is_worse_than_what_is_left_of_the_one_before(name: str) -> None:
    made = whole(name)
    request = next_request(made(ASKED))
    rest = request.remainder
    assert rest is not None
    assert rest.shape == (DEPTH - 1, SPACE.size)
    root = last(start(made.search, request))
    actions = grow(made.search, root, jnp.asarray(request.goal)).rollout.actions
    np.testing.assert_allclose(actions[0, : DEPTH - 1], rest, atol=1e-4)
    left = jax.jit(partial(simulate, made.search))(root.phi, root.now, jnp.asarray(request.goal), actions)
    assert bool(left.allowed[0])
    found = made(request)
    assert chosen(found).cost_after <= float(left.cost[0]) + 1e-7
    if isinstance(made, TreePlanner):
        assert found.branches[-1].origin == "continued"
        assert found.branches[-1].cost_before == pytest.approx(float(left.cost[0]), rel=1e-3, abs=1e-7)


@pytest.mark.parametrize("name", names())
def test_a_remainder_is_a_branch_with_the_actions_of_every_task(name: str) -> None:
    space = load(name).actions
    config = replace(search(depth=DEPTH), space=space, guided=False)
    rest = space.sample(np.random.default_rng(0), rope(), POSE, DEPTH - 1)
    tree = start(config, replace(ASKED, tool=POSE, remainder=rest))
    np.testing.assert_array_equal(tree.first[-1], rest[0])
    np.testing.assert_array_equal(tree.later[-1, : DEPTH - 2], rest[1:])


@pytest.mark.parametrize("name", planners())
def test_a_remainder_changes_its_own_samples_alone(name: str) -> None:
    made = whole(name)
    request = replace(ASKED, remainder=np.asarray(start(made.search, ASKED).first[:1]) + 0.01)
    without, with_it = start(made.search, ASKED), start(made.search, request)
    for before, after in ((without.first, with_it.first), (without.later, with_it.later)):
        assert before.shape == after.shape
        np.testing.assert_array_equal(before[:-1], after[:-1])
    assert request.remainder is not None
    np.testing.assert_array_equal(with_it.first[-1], request.remainder[0])


@pytest.mark.parametrize("name", ["cem_mpc", "diff_cem_mpc", "mppi"])
def test_samples_are_shifted_to_the_remainder_by_half(name: str) -> None:
    made = whole(name)
    assert isinstance(made, SamplingPlanner)
    rest = np.asarray(start(made.search, replace(ASKED, seed=5)).first[:1])
    request = replace(ASKED, remainder=rest)
    begun = made.shift(start(made.search, request), request)
    near = np.abs(np.asarray(begun.first) - rest).max(1) < 5 * made.schedule.spread * SPACE.scale().max()
    half = made.schedule.continued
    assert half == -(-made.search.branches // 2)
    assert near[-half:].all()
    assert near.sum() < made.search.branches
    assert len(np.unique(np.asarray(begun.first), axis=0)) == made.search.branches


@pytest.mark.parametrize("ablation", [None, "no_remainder"])
def test_an_ablation_leaves_the_remainder_out(ablation: str | None, monkeypatch: pytest.MonkeyPatch) -> None:
    told, rest = list[PlanRequest](), np.zeros((1, SPACE.size), np.float32)

    def planner_of(*_: object) -> Callable[[PlanRequest], None]:
        return told.append

    monkeypatch.setattr(jit_cache, "planner", planner_of)
    model, method = jit_cache.nominal_model("rope_push"), Method.of(ablation=ablation)
    worker_api.plan("rope_push", "cpu", ASKED.observed, ASKED.goal, model, 0, method=method, remainder=rest)
    assert [request.remainder is rest for request in told] == [ablation is None]


def test_a_policy_alone_does_not_go_on_with_the_plan_before() -> None:
    alone = make_planner(Method.of(ablation="no_planning"), search(), TASK.descent, 1)
    assert isinstance(alone, TreePlanner)
    request = replace(ASKED, remainder=np.zeros((1, SPACE.size), np.float32))
    made, without = alone(request), alone(ASKED)
    assert [branch.origin for branch in made.branches] == ["policy"]
    assert made.motion.digest() == without.motion.digest()


@pytest.fixture(scope="module")
def made() -> Branch:
    return chosen(planner()(ASKED))


def test_what_is_left_of_a_plan_is_of_use_where_its_prediction_came_true(made: Branch) -> None:
    rest = remainder_of(made, ASKED.observed, made.predicted)
    np.testing.assert_array_equal(rest, made.actions[1:])
    noisy = made.predicted + np.random.default_rng(0).normal(0.0, 0.0015, made.predicted.shape).astype(np.float32)
    assert remainder_of(made, ASKED.observed, noisy) is not None
    assert remainder_of(made, ASKED.observed, ASKED.observed) is None
    assert remainder_of(made, ASKED.observed, rope(-0.1)) is None


def test_of_a_motion_that_moves_nothing_as_predicted_there_is_a_remainder(made: Branch) -> None:
    missed = replace(made, predicted=ASKED.observed)
    noisy = ASKED.observed + np.random.default_rng(0).normal(0.0, 0.0015, ASKED.observed.shape).astype(np.float32)
    assert remainder_of(missed, ASKED.observed, noisy) is not None


def test_of_one_action_nothing_is_left(made: Branch) -> None:
    assert remainder_of(replace(made, actions=made.actions[:1]), ASKED.observed, made.predicted) is None
