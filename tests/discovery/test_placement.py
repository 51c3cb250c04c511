"""A study elsewhere is simulated about the middle of the table and told where it was."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.core.measured_setup import FoundTable
from app.discovery.checks.placement import centre, move_back, reach_m
from app.discovery.dataset.model_under_test import REACH_M, setup_of
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.jobs.discovery_subject import subject_of
from app.report import show_case, write_report
from app.tasks import load
from tests.discovery.test_limits import GOOD, SUBJECT, each
from tests.ui.report.cases import a_set

ORIGIN_M = (3.0, -1.5)


def elsewhere() -> Study:
    """The good study three metres away."""
    shift = np.array([*ORIGIN_M, 0.0])

    def view(it: ProjectionView) -> ProjectionView:
        return replace(it, points=(it.points + shift).astype(np.float32))

    def push(it: Push) -> Push:
        track = it.command.with_positions(it.command.positions + shift)
        return replace(it, before=view(it.before), during=(), after=view(it.after), command=track, measured=track)

    return each(push)


def test_a_study_on_the_tasks_table_stays_where_it_is() -> None:
    assert centre(GOOD, SUBJECT) is GOOD
    assert reach_m(GOOD, SUBJECT) == REACH_M


def test_one_elsewhere_is_moved_to_the_middle_and_not_turned() -> None:
    far = elsewhere()
    here = centre(far, SUBJECT)
    shift = np.array([*here.origin_m, 0.0])
    for one, other in zip(far.pushes, here.pushes, strict=True):
        np.testing.assert_allclose(other.before.points + shift, one.before.points, atol=1e-6)
        np.testing.assert_allclose(other.command.positions + shift, one.command.positions, atol=1e-9)
    mean = np.concatenate([push.before.points for push in here.pushes]).mean(0)[:2]
    assert mean == pytest.approx([0.55, 0.0], abs=0.006)
    assert centre(here, SUBJECT).pushes is here.pushes


def test_one_that_reaches_beyond_the_table_is_told_where_it_was_however_often_it_is_moved() -> None:
    first, *others = elsewhere().pushes
    far_off = first.command.with_positions(first.command.positions + np.array([1.0, 0.0, 0.0]))
    here = centre(replace(GOOD, pushes=(replace(first, command=far_off, measured=far_off), *others)), SUBJECT)
    again = centre(here, SUBJECT)
    assert again.pushes is not here.pushes
    assert again.origin_m == pytest.approx(here.origin_m, abs=0.011)
    where = again.pushes[1].command.positions + np.array([*again.origin_m, 0.0])
    np.testing.assert_allclose(where, others[0].command.positions, atol=1e-9)


def test_what_is_drawn_is_moved_back(tmp_path: Path) -> None:
    case, shift = a_set(), np.array([*ORIGIN_M, 0.0])
    told = move_back(replace(case, setup=setup_of(subject_of(load("rope_push@rods"))), origin_m=ORIGIN_M), ORIGIN_M)
    np.testing.assert_allclose(told.arrows.places, case.arrows.places + shift[:2], atol=1e-6)
    for one, other in zip(case.examples, told.examples, strict=True):
        np.testing.assert_allclose(other.before, one.before + shift, atol=1e-6)
        np.testing.assert_allclose(other.tool, one.tool + shift)
    assert case.next_push is not None
    assert told.next_push is not None
    np.testing.assert_allclose(told.next_push.track.positions, case.next_push.track.positions + shift)
    assert move_back(case, (0.0, 0.0)) is case
    write_report(tmp_path / "report.html", told)
    page = (tmp_path / "report.html").read_text(encoding="utf-8")
    assert "Object: a rope 0.400 m long" in page
    assert show_case(told) is not None
    assert FoundTable().words == "Table: at height 0, as was said."
