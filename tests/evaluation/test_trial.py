"""Trials and their ablations: which of them learn online, and which count as a success."""

import pytest

from app.evaluation.episode import EpisodeResults
from app.evaluation.trial import WHOLE, Trial


def trial(task: str, ablation: str, *, planner: str = "dipac", online: bool = False) -> Trial:
    return Trial(task=task, planner=planner, ablation=ablation, seed=0, preset="cpu", online=online)


@pytest.mark.parametrize("planner", ["dipac", "cem_mpc"])
def test_a_model_that_is_of_another_object_goes_on_learning_unasked(planner: str) -> None:
    assert trial("rod_to_rope", WHOLE, planner=planner).follows


def test_other_models_learn_in_use_where_that_is_asked_for() -> None:
    assert not trial("rope_push", WHOLE).follows
    assert trial("rope_push", WHOLE, online=True).follows


@pytest.mark.parametrize("ablation", ["no_online", "no_calibration", "no_planning"])
@pytest.mark.parametrize("online", [True, False])
def test_nothing_is_learnt_without_calibration_or_where_no_decision_heeds_it(ablation: str, online: bool) -> None:
    assert not trial("rod_to_rope", ablation, online=online).follows


def test_what_was_reached_when_it_was_seen_stays_reached_and_else_the_end_counts() -> None:
    played = EpisodeResults(reached=[False, False, True, False])
    assert not played.success
    played.done = 2
    assert played.success
    played.failure = "no branch is left"
    assert played.success
    assert not EpisodeResults(reached=[False, True], failure="no branch is left").success
    assert not EpisodeResults().success
