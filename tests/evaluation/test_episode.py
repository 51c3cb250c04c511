"""Episodes in lock step: every motion has passed the application's gate, and the first that does not ends them."""

from dataclasses import replace
from typing import Any

import numpy as np
import pytest

from app.config import Site
from app.core.dialogue.approval import AUTOMATIC
from app.evaluation.episode import EpisodeStep, EvaluationConfig, play
from app.jobs import worker_api
from app.jobs.worker_api import nominal_model
from app.planner.method import Method
from app.planner.search.plan import Plan
from app.planner.search.request import Actions, remainder_of
from app.tasks import load

ACTIONS = 2


@pytest.fixture
def order() -> EvaluationConfig:
    """A short episode of the initial policy alone."""
    return EvaluationConfig(
        task=load("rope_push"),
        preset="cpu",
        seed=0,
        method=Method.of(ablation="no_planning"),
        model=nominal_model("rope_push"),
        eyes="truth",
        actions=ACTIONS,
        play_on=True,
    )


def test_every_motion_leads_back_to_the_particles_it_was_approved_for(order: EvaluationConfig) -> None:
    steps = list[EpisodeStep]()
    assert play(order, steps.append).failure == ""
    assert len(steps) == ACTIONS
    for step in steps:
        executed, approved, proposal = step.transition.executed, step.approved, step.proposal
        assert (executed.approved_id, executed.cause) == (approved.id, (approved.id,))
        assert approved.cause == (proposal.id, step.decision.id)
        assert proposal.cause == (step.before.id, order.episode.goal.id, order.model.id)
        assert approved.digest == step.plan.motion.digest()
        assert approved.operator == AUTOMATIC


def test_an_episode_ends_with_a_motion_that_the_gate_does_not_let_pass(order: EvaluationConfig) -> None:
    steps, site = list[EpisodeStep](), Site()
    strict = replace(site, timing=replace(site.timing, plan_max_drift_m=-1.0))
    played = play(order, steps.append, strict)
    assert "has moved" in played.failure
    assert (len(played.chamfer_m2), steps) == (1, [])


def test_a_plan_starts_from_what_is_left_of_the_one_before_as_far_as_that_came_true(
    order: EvaluationConfig, monkeypatch: pytest.MonkeyPatch
) -> None:
    steps, told, plan = list[EpisodeStep](), list[Actions | None](), worker_api.plan

    def longer(*asked: Any, remainder: Actions | None = None, **said: Any) -> Plan:
        told.append(remainder)
        found = plan(*asked, **said)
        chosen = replace(found.branches[0], actions=np.repeat(found.branches[0].actions, 3, axis=0))
        return replace(found, branches=(chosen,))

    monkeypatch.setattr(worker_api, "plan", longer)
    assert play(order, steps.append).failure == ""
    assert told[0] is None
    for step, rest in zip(steps[:-1], told[1:], strict=True):
        expected = remainder_of(step.plan.branches[0], step.before.positions, step.after.positions)
        np.testing.assert_array_equal(rest, expected)
        assert rest is not None
        assert len(rest) == 2
