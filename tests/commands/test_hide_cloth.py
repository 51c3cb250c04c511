"""`dipac hide --task cloth_hang`: whole recordings of carries, with the gripper's opening, that discovery reads."""

from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.core.errors import UsageError
from app.core.messages import Executed, Message, Sighting
from app.recording.format.integrity import inspect
from app.recording.read.reader import read_messages
from app.services.study import read_study
from app.tasks.cloth_hang import GRIPPER
from tests.commands.test_hide import recordings, truth

SMALL = ["--task", "cloth_hang", "--seed", "730917", "--episodes", "1", "--pushes", "2"]


@pytest.fixture(scope="module")
def late(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hide") / "late"
    assert main(["hide", "command_delay=0.2", *SMALL, "-o", str(folder)]) == 0
    return folder


def messages(path: Path) -> list[Message]:
    return list(read_messages(path, [Executed, Sighting]))


def test_a_recording_is_whole_and_the_gripper_closes_in_its_first_carry(late: Path) -> None:
    (path,) = recordings(late)
    inspect(path)
    first, second = (each for each in messages(path) if isinstance(each, Executed))
    assert first.commanded.shape[1] == first.measured.shape[1] == 7
    assert (first.openings[0], first.openings[-1]) == pytest.approx((GRIPPER.opening_m, 0.004))
    assert np.all(second.openings < GRIPPER.closed_m)
    assert np.array_equal(second.commanded[0], first.commanded[-1])
    assert any(len(each.table) > 300 for each in messages(path) if isinstance(each, Sighting))


def test_the_encoders_tell_the_delay_and_the_truth_names_it(late: Path) -> None:
    said = truth(late)
    assert [each["effect"] for each in said["effects"]] == ["command_delay"]
    assert said["world"]["membrane_n_m"] == pytest.approx(100.0, rel=0.3)
    study = read_study(recordings(late))
    for push in study.pushes:
        assert push.measured is not None
        assert push.command.poses.shape[1] == push.measured.poses.shape[1] == 8
        later = push.command.poses_at(push.command.times_s - 0.2)
        assert np.abs(push.measured.positions - later[:, :3]).max() < 1e-3
        assert push.measured.poses[:, 3:7] == pytest.approx(later[:, 3:7], abs=1e-6)
    first = study.pushes[0].measured
    assert first is not None
    closed_s = first.times_s[np.argmax(first.poses[:, 7] < GRIPPER.closed_m)]
    assert closed_s - first.times_s[0] == pytest.approx(0.2 + 0.1 + 0.3 * 0.78, abs=0.05)
    carried = study.pushes[1].after.points.mean(0) - study.pushes[0].before.points.mean(0)
    assert np.linalg.norm(carried) > 0.02


def test_what_a_cloth_cannot_have_is_refused_before_anything_is_made(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["hide", "maxwell", *SMALL, "-o", str(tmp_path / "session")]) == UsageError.exit_code
    assert "maxwell is nothing that Cloth can have. What can be hidden: abrupt_change, " in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
