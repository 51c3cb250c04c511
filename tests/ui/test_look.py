"""Looking at a plan: the branch and the moment that are shown, and the text of the tab Plans; without a browser."""

import math
from dataclasses import replace

import numpy as np
import pytest

from app.core.dialogue import words
from app.core.geometry.chamfer import chamfer_m2
from app.core.messages import Branch
from app.ui.plans import cards
from app.ui.plans.look import (
    BEST,
    NONE,
    PreviewState,
    last_moment,
    moments,
    motion_at,
    names,
    selected_preview,
    to_goal_m2,
)
from tests.ui import synthetic

OBSERVED = synthetic.rope(0.5)
PROPOSAL = synthetic.proposal(OBSERVED, branches=7)
GOAL = synthetic.rope(-0.45, 2)


def without_frames(branch: Branch) -> Branch:
    return replace(branch, frames=np.zeros((0, 0, 3), np.float32), tools=np.zeros((0, 3), np.float32))


def test_every_branch_has_a_name_of_its_own() -> None:
    assert len(set(names(PROPOSAL))) == 7
    assert names(PROPOSAL)[0] == "1 policy"


@pytest.mark.parametrize("nonsense", [BEST, NONE, "99 random", "", "1 policy "])
def test_what_a_widget_says_that_makes_no_sense_is_the_proposed_branch_alone(nonsense: str) -> None:
    look = selected_preview(PROPOSAL, nonsense, nonsense, 0)
    assert (look.at, look.beside, look.share) == (PROPOSAL.best, None, 0.0)


@pytest.mark.parametrize(("moment", "share"), [(-5, 0.0), (0, 0.0), (4, 0.5), (8, 1.0), (10**9, 1.0)])
def test_a_moment_is_a_share_of_the_horizon_from_now_to_the_end(moment: int, share: float) -> None:
    look = selected_preview(PROPOSAL, "2 random", "3 random", moment)
    assert (look.at, look.beside, look.share) == (1, 2, share)


def test_a_ghost_is_the_frame_and_the_tool_of_the_moment() -> None:
    branch = PROPOSAL.branches[2]
    for index in range(synthetic.MOMENTS):
        ghost = selected_preview(PROPOSAL, "3 random", NONE, index).ghost(branch)
        np.testing.assert_array_equal(ghost.particles, branch.frames[index])
        np.testing.assert_array_equal(ghost.tool, branch.tools[index])


@pytest.mark.parametrize(("depth", "count"), [(1, 2), (2, 3)])
def test_of_a_branch_of_which_no_moments_were_kept_those_are_shown_that_always_are(depth: int, count: int) -> None:
    branch = without_frames(replace(PROPOSAL.branches[1], actions=np.zeros((depth, 42), np.float32)))
    frames, tools = moments(PROPOSAL, branch)
    assert len(frames) == len(tools) == count
    np.testing.assert_array_equal(frames[0], OBSERVED)
    np.testing.assert_array_equal(frames[1], branch.predicted)
    np.testing.assert_array_equal(tools[:2], branch.tool_path[[0, -1]])


def test_a_plan_that_kept_nothing_can_be_looked_at_too() -> None:
    plain = replace(PROPOSAL, branches=tuple(without_frames(branch) for branch in PROPOSAL.branches))
    assert last_moment(plain) == 2
    branch = replace(without_frames(plain.branches[0]), tool_path=np.zeros((0, 3), np.float32))
    assert np.isnan(selected_preview(plain, "1 policy", NONE, 2).ghost(branch).tool).all()


def test_which_motion_is_being_made() -> None:
    branch = PROPOSAL.branches[0]
    assert [motion_at(branch, share) for share in (0.0, 0.1, 0.5, 0.6, 1.0)] == [(1, 2)] * 3 + [(2, 2)] * 2


def test_the_distances_are_those_of_the_particles_that_are_drawn() -> None:
    look = PreviewState(proposal=PROPOSAL, at=1, beside=2, share=1.0)
    shown = cards.moment(look, GOAL)
    for branch in (look.branch, look.other):
        assert branch is not None
        expected_m2 = float(chamfer_m2(branch.frames[-1], GOAL))
        assert to_goal_m2(look.ghost(branch), GOAL) == pytest.approx(expected_m2)
        assert words.distance(expected_m2) in shown
    assert words.NOTHING in cards.moment(look, None)


def test_a_branch_that_became_non_finite_is_marked_and_has_no_distance() -> None:
    broken = replace(PROPOSAL.branches[5], frames=np.full((9, 300, 3), np.nan, np.float32))
    proposal = replace(PROPOSAL, branches=(*PROPOSAL.branches[:5], broken, PROPOSAL.branches[6]))
    look = PreviewState(proposal=proposal, at=5, share=1.0)
    assert math.isnan(to_goal_m2(look.ghost(broken), GOAL))
    assert cards.branches(proposal, look).count("dropped: not finite") == 1


def test_the_table_has_every_branch_with_its_costs_and_terms_and_marks_three() -> None:
    look = PreviewState(proposal=PROPOSAL, at=1, beside=2)
    shown = cards.branches(PROPOSAL, look)
    assert shown.count("<tr") == 1 + 7
    for branch in PROPOSAL.branches:
        if branch.finite:
            assert f"{words.number(branch.cost_before)} → {words.number(branch.cost_after)}" in shown
    assert shown.count("title='chamfer: -0.0021; contact: 0.31'") == 6
    for mark in ("dp-best", "dp-looked", "dp-compared"):
        assert shown.count(mark) == 1


def test_no_term_from_outside_becomes_markup() -> None:
    hostile = replace(PROPOSAL.branches[0], terms={"'><img src=x onerror=alert(1)>": 1.0})
    proposal = replace(PROPOSAL, branches=(hostile,), best=0)
    shown = cards.branches(proposal, PreviewState(proposal=proposal, at=0))
    assert "<img" not in shown
    assert "'><" not in shown.split("title=")[1].split("<td>")[0][2:-1]
