"""Reading a discovery's folder for the console: the verdict in it, and errors that say what is wrong with it."""

from dataclasses import replace
from pathlib import Path

import msgspec
import numpy as np
import pytest

from app.commands._case import VERDICT, read_case
from app.config import Site
from app.core.errors import RecordingError, UsageError
from app.policy.random_carries import carry_design, random_carry
from app.policy.random_pushes import PushDesign, random_track
from app.report import verdict_json
from tests.planner.table import rope
from tests.ui.report import cases


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    case = cases.a_set()
    assert case.next_push is not None
    track = random_track(np.random.default_rng(1), rope(), PushDesign(), start_s=0.0, height_m=0.006)
    case = replace(case, next_push=replace(case.next_push, track=track))
    (tmp_path / VERDICT).write_text(verdict_json(case), encoding="utf-8")
    return tmp_path


def test_the_verdict_comes_with_its_causes_in_order_and_the_push_that_it_asks_for(folder: Path) -> None:
    case, found = cases.a_set(), read_case(folder, "rope_push", Site(), 1.0, True)
    verdict = found.verdict
    assert (verdict.kind, verdict.sentences) == ("set", case.sentences)
    assert [cause.effect for cause in verdict.causes] == [cause.effect for cause in case.causes]
    chances = [cause.probability for cause in verdict.ranking]
    assert chances == sorted(chances, reverse=True)
    assert verdict.promised_share == pytest.approx(case.gain.extended_mm / case.gain.still_mm)
    (asked,) = found.asked
    assert Site().limits.workspace.contains(asked.positions)


def test_another_model_has_promised_nothing(folder: Path) -> None:
    assert np.isnan(read_case(folder, "rope_push", Site(), 1.0, False).verdict.promised_share)


def test_a_folder_without_a_verdict_is_said_with_what_to_give(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match=r"verdict\.json: No such file.*give --case the folder"):
        read_case(tmp_path, "rope_push", Site(), 1.0, True)


def test_what_is_wrong_in_a_verdict_is_said_by_its_place(folder: Path) -> None:
    plain = msgspec.json.decode((folder / VERDICT).read_bytes())
    plain["causes"][0]["size"] = "large"
    (folder / VERDICT).write_bytes(msgspec.json.encode(plain))
    with pytest.raises(RecordingError, match=r"\$\.causes\[0\]\.size"):
        read_case(folder, "rope_push", Site(), 1.0, True)


def test_a_verdict_about_another_task_is_refused(folder: Path) -> None:
    with pytest.raises(UsageError, match="is about task 'rope_push', not 'cloth'"):
        read_case(folder, "cloth", Site(), 1.0, True)


@pytest.mark.parametrize("task", ["cloth_hang", "pour_water"])
def test_the_next_motion_of_a_tool_that_holds_the_object_goes_on_from_its_first_pose(tmp_path: Path, task: str) -> None:
    case = cases.a_set()
    assert case.next_push is not None
    start = np.array([0.55, -0.15, 0.25, 0.0, 1.0, 0.0, 0.0, 0.004])
    track = random_carry(np.random.default_rng(1), start, carry_design(1, 1), start_s=0.0, closed_m=0.004)
    case = replace(case, amount=replace(case.amount, task=task), next_push=replace(case.next_push, track=track))
    (tmp_path / VERDICT).write_text(verdict_json(case), encoding="utf-8")
    found = read_case(tmp_path, task, Site(), 1.0, True)
    assert found.verdict.next_push == case.next_push.text
    (asked,) = found.asked
    assert asked.continues
    np.testing.assert_allclose(asked.poses[0], start)
    np.testing.assert_allclose(asked.poses[-1], track.poses[-1], atol=1e-4)
