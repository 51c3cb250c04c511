"""Branches at moments between now and their end: what they show is what was simulated, and nothing is decided by it."""

from dataclasses import replace
from functools import partial

import jax
import jax.numpy as jnp
import numpy as np
import pytest

from app.config import Site
from app.jobs import jit_cache
from app.planner.search.plan import Plan
from app.planner.search.request import PlanRequest
from app.planner.search.rollout_frames import MOMENTS, MOST_PARTICLES, grow, resimulate, thin_out
from app.planner.search.sampling import SampleSchedule, SamplingPlanner
from app.planner.search.tree import TreeConfig, simulate, start
from app.planner.search.updates import Elites
from tests.planner.table import PARTICLES, PHI, SPACE, TASK, planner, rope, search, to_the_bit

ASKED = PlanRequest(observed=rope(), goal=rope(0.05), phi=PHI)
ROUNDED_M = 1e-6


def filmed(**changes: int) -> TreeConfig:
    return replace(search(**changes), part=jit_cache.moving("rope_push", PARTICLES))


@pytest.fixture(scope="module")
def decision() -> Plan:
    return replace(planner(), search=filmed())(ASKED)


def test_frames_lead_from_what_was_seen_to_the_end_by_the_state_after_the_first_action(decision: Plan) -> None:
    for branch in decision.branches:
        assert branch.frames.shape == (MOMENTS + 1, PARTICLES, 3)
        assert np.isfinite(branch.frames).all()
        np.testing.assert_allclose(branch.frames[0], ASKED.observed, atol=ROUNDED_M)
        np.testing.assert_allclose(branch.frames[MOMENTS // 2], branch.predicted, atol=ROUNDED_M)
        np.testing.assert_array_equal(branch.frames[-1], branch.final)


def test_the_object_moves_little_by_little(decision: Plan) -> None:
    frames = decision.branches[decision.best].frames
    moved_m = np.linalg.norm(np.diff(frames, axis=0), axis=2).max(1)
    whole_m = np.linalg.norm(frames[MOMENTS // 2] - frames[0], axis=1).max()
    assert moved_m.max() < 0.9 * whole_m


def test_the_tool_is_on_its_path_at_every_moment(decision: Plan) -> None:
    branch = decision.branches[decision.best]
    assert branch.tools.shape == (MOMENTS + 1, 3)
    np.testing.assert_allclose(branch.tools[[0, MOMENTS // 2]], branch.tool_path[[0, -1]], atol=ROUNDED_M)
    apart = np.linalg.norm(branch.tools[: MOMENTS // 2 + 1, None] - branch.tool_path[None], axis=2).min(1)
    assert apart.max() < ROUNDED_M


def test_branches_are_grown_costed_and_shown_in_one_simulation() -> None:
    tree, goal = filmed(), jnp.asarray(ASKED.goal)
    begun = start(tree, ASKED)
    grown, whole = grow(tree, begun, goal), grow(search(), begun, goal).rollout
    again = jax.jit(partial(simulate, tree))(begun.phi, begun.now, goal, whole.actions)
    np.testing.assert_allclose(grown.rollout.actions, whole.actions, atol=1e-5)
    np.testing.assert_allclose(grown.rollout.cost, again.cost, rtol=1e-3, atol=1e-6)
    shown = resimulate(tree, begun.phi, begun.now, goal, grown.rollout.actions)
    np.testing.assert_allclose(grown.frames, shown.frames, atol=ROUNDED_M)
    np.testing.assert_allclose(grown.tools, shown.tools, atol=ROUNDED_M)
    assert not grow(search(), begun, goal).frames.size


def test_what_was_not_descended_from_is_shown_as_it_was_grown_and_the_rest_anew() -> None:
    planned = replace(planner(), search=replace(filmed(branches=6), descended=2))(ASKED)
    begun = start(filmed(branches=6), ASKED)
    frames = np.asarray(grow(filmed(branches=6), begun, jnp.asarray(ASKED.goal)).frames)
    same = [
        bool(np.allclose(branch.frames, its, atol=ROUNDED_M))
        for branch, its in zip(planned.branches, frames, strict=True)
    ]
    better = [branch.cost_after < branch.cost_before for branch in planned.branches]
    assert 1 <= sum(better) <= 2
    assert same == [not each for each in better]
    for branch in planned.branches:
        np.testing.assert_array_equal(branch.frames[-1], branch.final)


@to_the_bit
def test_a_film_changes_no_decision(decision: Plan) -> None:
    plain = planner()(ASKED)
    assert plain.motion.digest() == decision.motion.digest()
    assert not len(plain.branches[0].frames)


def test_a_population_is_filmed_as_far_as_it_is_kept() -> None:
    tree = replace(filmed(branches=6, depth=1), guided=False)
    schedule = SampleSchedule(generations=2, kept=3, update=Elites(count=2))
    cem = SamplingPlanner(search=tree, schedule=schedule, descent=TASK.descent)
    found = cem(ASKED)
    assert len(found.branches) == 3
    for branch in found.branches:
        assert len(branch.frames) == len(branch.tools) == MOMENTS + 1
        np.testing.assert_allclose(branch.frames[-1], branch.final, atol=ROUNDED_M)
        end = SPACE.motion(branch.actions[0], np.zeros(8), Site()).positions[-2]
        np.testing.assert_allclose(branch.tools[-1], end, atol=ROUNDED_M)


def test_of_a_crowd_every_second_or_third_is_kept() -> None:
    crowd = np.arange(6000, dtype=np.float32).reshape(-1, 3)
    assert len(thin_out(crowd)) <= MOST_PARTICLES
    assert len(thin_out(crowd[:MOST_PARTICLES])) == MOST_PARTICLES
    np.testing.assert_array_equal(thin_out(crowd)[1], crowd[4])
