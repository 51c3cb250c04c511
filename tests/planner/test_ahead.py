"""Plans made for where the object is predicted to lie: taken where it lies so, and nowhere else."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
import pytest

from app.core.messages import Branch
from app.jobs import jit_cache, worker_api
from app.planner.method import Method, planners
from app.planner.planner_factory import make_planner
from app.planner.search.ahead import AheadPlanner
from app.planner.search.plan import Plan, TreePlanner
from app.planner.search.request import Ahead, PlanRequest
from app.planner.search.sampling import SamplingPlanner
from tests.planner.table import PHI, TASK, rope, search

DEPTH = 2
ASKED = PlanRequest(observed=rope(), goal=rope(0.05, 0.2), phi=PHI, seed=1)
OTHERWISE = replace(ASKED, seed=2)


def made(name: str = "dipac") -> AheadPlanner:
    planner = make_planner(Method(planner=name), search(depth=DEPTH), TASK.descent, 1)
    assert isinstance(planner, TreePlanner | SamplingPlanner)
    return AheadPlanner(planner=planner, search=planner.search)


def made_ahead(plan: Plan, branches: Sequence[Branch] | None = None) -> Ahead:
    return Ahead(predicted=ASKED.observed, branches=branches or plan.branches, best=plan.best)


def after(plan: Plan, *, promised: float | None = None, actions: float = 0.0) -> PlanRequest:
    """The next decision, with that plan as made ahead: each branch promises so much, and has so much more to do."""
    branches = [
        replace(
            branch,
            cost_after=branch.cost_after if promised is None else promised,
            actions=branch.actions + np.float32(actions),
        )
        for branch in plan.branches
    ]
    return replace(ASKED, seed=2, ahead=made_ahead(plan, branches))


def lies(branch: Branch, wrong_m: float, *, promised: float) -> bool:
    """True if a prediction that was wrong by so much came true, as far as a plan of that cost needs it."""
    ahead = Ahead(predicted=rope(), branches=[replace(branch, cost_after=promised)], best=0)
    return ahead.came_true(rope() + np.float32([0.0, 0.0, wrong_m]))


def chosen(plan: Plan) -> Branch:
    return plan.branches[plan.best]


def same_actions(plan: Plan, other: Plan) -> bool:
    return len(plan.branches) == len(other.branches) and all(
        np.allclose(mine.actions, its.actions, atol=1e-5)
        for mine, its in zip(plan.branches, other.branches, strict=True)
    )


def test_a_prediction_came_true_where_it_is_wrong_by_little_beside_what_is_promised() -> None:
    branch = made()(ASKED).branches[0]
    assert lies(branch, 0.004, promised=-400e-6)
    assert not lies(branch, 0.004, promised=-300e-6)
    assert not lies(branch, 0.0, promised=1e-6)


@pytest.mark.parametrize("name", planners())
def test_where_the_object_lies_as_predicted_the_plan_made_ahead_is_the_plan(name: str) -> None:
    planner = made(name)
    ahead = planner(ASKED)
    taken = planner(after(ahead))
    assert (ahead.ahead, taken.ahead) == (False, True)
    assert same_actions(taken, ahead)
    assert [branch.origin for branch in taken.branches] == [branch.origin for branch in ahead.branches]
    assert taken.best == ahead.best
    np.testing.assert_allclose(taken.motion.positions, ahead.motion.positions, atol=1e-5)
    np.testing.assert_allclose(taken.predicted, ahead.predicted, atol=1e-4)
    assert chosen(taken).cost_after == pytest.approx(chosen(ahead).cost_after, rel=1e-3)


@pytest.mark.parametrize("name", planners())
def test_where_the_object_lies_elsewhere_the_planner_plans_anew(name: str) -> None:
    planner = made(name)
    ahead = planner(ASKED)
    elsewhere = replace(OTHERWISE, observed=rope(-0.06, -0.3))
    plan, anew = planner(replace(elsewhere, ahead=after(ahead).ahead)), planner(elsewhere)
    assert not plan.ahead
    assert same_actions(plan, anew)
    assert chosen(plan).cost_after == pytest.approx(chosen(anew).cost_after)


def test_what_promised_more_than_it_keeps_or_nothing_is_not_taken() -> None:
    planner = made()
    ahead = planner(ASKED)
    cost = min(branch.cost_after for branch in ahead.branches)
    assert cost < 0.0
    for times, kept in ((1.05, True), (1.2, False), (-1.0, False), (0.0, False)):
        assert planner(after(ahead, promised=times * cost)).ahead is kept, times


def test_a_plan_ahead_none_of_which_can_be_made_is_not_taken() -> None:
    planner = made()
    ahead = planner(ASKED)
    plan = planner(after(ahead, actions=float("nan")))
    assert not plan.ahead
    assert same_actions(plan, planner(OTHERWISE))


def test_what_a_branch_promises_that_would_not_have_been_followed_counts_for_nothing() -> None:
    planner = made()
    ahead = planner(ASKED)
    other = (ahead.best + 1) % len(ahead.branches)
    boasting = [
        replace(branch, cost_after=-1.0) if index == other else branch for index, branch in enumerate(ahead.branches)
    ]
    assert made_ahead(ahead, boasting).promise_m2 == -chosen(ahead).cost_after
    assert planner(replace(OTHERWISE, ahead=made_ahead(ahead, boasting))).ahead


def test_the_job_takes_what_was_planned_ahead_only_where_it_is_given(monkeypatch: pytest.MonkeyPatch) -> None:
    planner = made().planner
    monkeypatch.setattr(jit_cache, "planner", lambda *_: planner)
    model = jit_cache.nominal_model("rope_push")
    ahead = worker_api.plan("rope_push", "cpu", ASKED.observed, ASKED.goal, model, 1)
    anew = worker_api.plan("rope_push", "cpu", ASKED.observed, ASKED.goal, model, 2)
    true = made_ahead(ahead)
    taken = worker_api.plan("rope_push", "cpu", ASKED.observed, ASKED.goal, model, 2, ahead=true)
    untrue = replace(true, predicted=rope(0.02))
    wrong = worker_api.plan("rope_push", "cpu", ASKED.observed, ASKED.goal, model, 2, ahead=untrue)
    assert (ahead.ahead, anew.ahead, taken.ahead, wrong.ahead) == (False, False, True, False)
    assert same_actions(wrong, anew)
    assert same_actions(taken, ahead)
    assert not same_actions(taken, anew)
