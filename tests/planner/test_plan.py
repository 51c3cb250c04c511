"""Whole decisions with the real simulator, on a small rope."""

import dataclasses
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.arm.gate import check_motion
from app.config import KeepOut, Limits, Reach, Site
from app.core.errors import PlanningError
from app.core.geometry.chamfer import chamfer_m2
from app.planner.search.plan import Plan
from app.planner.search.request import PlanRequest
from app.planner.search.rollout_frames import grow
from app.planner.search.tree import simulate, start, state_after
from app.policy.base import PARKED_POSE
from app.tasks.rope_push import TASK
from tests.planner.table import PHI, SPACE, now, planner, rope, search, to_the_bit
from tests.programs import program

START, GOAL = rope(), rope(0.05)
ASKED = PlanRequest(observed=START, goal=GOAL, phi=PHI)


@pytest.fixture(scope="module")
def decision() -> Plan:
    return planner()(ASKED)


def test_a_decision_descends_and_is_predicted_to_bring_the_rope_nearer_to_its_goal(decision: Plan) -> None:
    best = decision.branches[decision.best]
    assert best.cost_after < best.cost_before
    assert decision.predicted_chamfer_m2 < 0.8 * decision.chamfer_m2
    assert decision.chamfer_m2 == pytest.approx(float(chamfer_m2(START, GOAL)))


def test_the_best_branch_is_the_cheapest(decision: Plan) -> None:
    costs = [branch.cost_after for branch in decision.branches if branch.finite]
    assert decision.branches[decision.best].cost_after == min(costs)


def test_no_branch_gets_worse_by_descent(decision: Plan) -> None:
    assert all(branch.cost_after <= branch.cost_before for branch in decision.branches)


def test_the_terms_of_a_branch_add_up_to_its_cost(decision: Plan) -> None:
    for branch in decision.branches:
        assert branch.terms["progress"] + branch.terms["contact"] == pytest.approx(branch.cost_after, abs=1e-7)


def test_the_motion_is_the_first_action_of_the_best_branch(decision: Plan) -> None:
    expected = SPACE.motion(decision.branches[decision.best].actions[0], PARKED_POSE, Site())
    assert decision.motion.digest() == expected.digest()


def test_a_plan_goes_around_what_the_site_keeps_free(decision: Plan) -> None:
    middle = decision.motion.positions.mean(axis=0)
    post = KeepOut(name="post", low=(*(middle[:2] - 0.02), 0.0), high=(*(middle[:2] + 0.02), 0.3))
    site = Site(limits=Limits(keep_out=(post,)))
    unaware = planner()(dataclasses.replace(ASKED, site=site))
    assert unaware.motion.digest() != decision.motion.digest(), "what enters the post is not chosen"
    weights = dataclasses.replace(TASK.weights, keep_out=(post,))
    aware = dataclasses.replace(planner(), search=dataclasses.replace(search(), weights=weights))
    plan = aware(dataclasses.replace(ASKED, site=site))
    for made in (unaware, plan):
        check_motion(made.motion, made.motion.digest(), site)
    # The branch that went through the post is drawn out of it by its cost.
    through = plan.branches[decision.best]
    assert through.cost_after < through.cost_before
    assert through.terms["trespass"] < through.cost_before
    total = through.terms["progress"] + through.terms["contact"] + through.terms["trespass"]
    assert total == pytest.approx(through.cost_after, abs=1e-7)


def test_where_every_branch_enters_what_is_kept_free_there_is_no_plan() -> None:
    everywhere = KeepOut(name="cover", low=(0.0, -1.0, -1.0), high=(1.0, 1.0, 0.05))
    with pytest.raises(PlanningError, match="enter what is kept free"):
        planner()(dataclasses.replace(ASKED, site=Site(limits=Limits(keep_out=(everywhere,)))))


def test_a_plan_stays_within_what_the_arm_reaches(decision: Plan) -> None:
    ways = [branch.tool_path for branch in decision.branches]
    farthest = [float(np.linalg.norm(way, axis=1).max()) for way in ways]
    # What was chosen before is out of reach now, and something else is not.
    nearest, chosen = min(farthest), farthest[decision.best]
    radius_m = (nearest + chosen) / 2 if nearest < chosen else chosen - 0.002
    reach = Reach(middle=(0.0, 0.0, 0.0), radius_m=radius_m, hand_m=0.0)
    site = Site(limits=Limits(reach=reach), travel_height_m=0.02)
    weights = dataclasses.replace(TASK.weights, reach=reach)
    aware = dataclasses.replace(planner(), search=dataclasses.replace(search(), weights=weights))
    plan = aware(dataclasses.replace(ASKED, site=site))
    assert plan.motion.digest() != decision.motion.digest()
    assert reach.beyond_m(plan.motion.poses).max() <= 0
    through = plan.branches[decision.best]
    total = through.terms["progress"] + through.terms["contact"] + through.terms["trespass"]
    assert total == pytest.approx(through.cost_after, abs=1e-7)


@to_the_bit
def test_the_same_seed_decides_the_same(decision: Plan) -> None:
    again = planner()(ASKED)
    assert again.motion.digest() == decision.motion.digest()


def test_the_tree_multiplies_matrices_in_full_precision_on_every_device() -> None:
    """The default of recent GPUs is TF32, whose ten bits leave positions in a workspace off by 0.2 mm."""
    tree = search()
    lowered = grow.lower(tree, start(tree, ASKED), jnp.asarray(ASKED.goal))
    products = [line for line in lowered.as_text().splitlines() if "dot_general" in line]
    assert products
    assert all("HIGHEST" in line for line in products), products


def test_a_tree_begins_with_the_policy_and_continues_every_branch_with_it() -> None:
    tree = search()
    begun = start(tree, ASKED)
    assert begun.first.shape == (tree.branches, SPACE.size)
    act = program(tree.policy.act)
    np.testing.assert_allclose(begun.first[0], act(begun.prepared, now(START, 1)).mean[0], atol=1e-6)
    actions = grow(tree, begun, jnp.asarray(ASKED.goal)).rollout.actions
    after = jax.jit(partial(state_after, tree))(begun.phi, begun.now, actions[:, 0])
    np.testing.assert_allclose(actions[:, 1], program(SPACE.project)(act(begun.prepared, after).mean, after), atol=1e-5)


def test_the_gradient_of_a_branchs_cost_agrees_with_central_differences() -> None:
    tree = search(branches=1, depth=1)
    goal = jnp.asarray(rope(0.06, 0.2))
    # A push across the middle that ends well inside the contact.
    action = jnp.zeros((1, 1, 42)).at[0, 0, :2].set(jnp.array([0.55, -0.03])).at[0, 0, 3::2].set(0.003)

    @jax.jit
    @jax.value_and_grad
    def cost(action: jax.Array) -> jax.Array:
        return simulate(tree, jnp.asarray(PHI)[None], now(START, 1), goal, action).cost.sum()

    direction = jnp.zeros_like(action).at[0, 0, 3::2].set(1.0)
    slope = float((cost(action)[1] * direction).sum())
    h = 2e-5
    secant = float(cost(action + h * direction)[0] - cost(action - h * direction)[0]) / (2 * h)
    assert slope == pytest.approx(secant, rel=0.1)


def test_a_tree_without_a_finite_branch_is_an_error_that_says_so() -> None:
    with pytest.raises(PlanningError, match="4 branches 4 became non-finite"):
        planner()(dataclasses.replace(ASKED, phi=np.full_like(PHI, np.nan)))


@to_the_bit
def test_what_was_rejected_is_not_proposed_again_while_there_is_another(decision: Plan) -> None:
    finder = planner()
    first = decision.branches[decision.best]
    again = finder(dataclasses.replace(ASKED, rejected=(first.tool_path,)))
    second = again.branches[again.best]
    assert np.linalg.norm((second.tool_path - first.tool_path)[[0, -1]], axis=1).max() > 0.02
    costs = sorted(branch.cost_after for branch in again.branches)
    assert second.cost_after in costs[1:]
    assert again.motion.digest() != decision.motion.digest()
    everything = tuple(branch.tool_path for branch in decision.branches)
    stubborn = finder(dataclasses.replace(ASKED, rejected=everything))
    assert stubborn.motion.digest() == decision.motion.digest()
