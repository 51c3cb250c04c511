"""`dipac evaluate` goes on where it was killed, mixes nothing up, and says what is wrong with an order."""

import json
import os
import signal
import subprocess
import sys
import time
from pathlib import Path
from typing import Any

import pytest

from app.__main__ import main
from app.core.errors import UsageError
from app.core.geometry.scene_description import Rope
from app.evaluation import results_log
from app.jobs.worker_api import nominal_model
from app.recording.exchange.model_file import save_model
from app.rig.simulated.effect_sampling import InjectionRequest, describe, draw
from tests.models import model_with

POLICY = ["--task", "rope_push", "--planner", "dipac", "--ablation", "no_planning", "--preset", "cpu"]
SHORT = [*POLICY, "--eyes", "truth", "--actions", "1", "--seeds", "3"]
PATIENCE_S = 300


@pytest.fixture
def folder(tmp_path: Path) -> Path:
    """A folder of results with its model: what demonstrations calibrate is tested where they are."""
    (tmp_path / "models").mkdir()
    save_model(tmp_path / "models" / "rope_push@rods.toml", nominal_model("rope_push@rods"))
    return tmp_path


def rows(folder: Path) -> list[dict[str, Any]]:
    return [json.loads(line) for line in (folder / "episodes.jsonl").read_text().splitlines()]


def killed_after_one(folder: Path) -> None:
    """Run it in a process group of its own, and kill that once the first episode is told."""
    command = [sys.executable, "-m", "app", "evaluate", *SHORT, "-o", str(folder)]
    process = subprocess.Popen(command, start_new_session=True, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        given_up_s = time.monotonic() + PATIENCE_S
        path = folder / "episodes.jsonl"
        while not (path.exists() and path.read_text().count("\n")):
            assert process.poll() is None
            assert time.monotonic() < given_up_s
            time.sleep(0.02)
    finally:
        os.killpg(process.pid, signal.SIGKILL)
        process.wait()


@pytest.mark.serial
def test_an_evaluation_that_was_killed_goes_on_and_plays_nothing_twice(
    folder: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    killed_after_one(folder)
    before = rows(folder)
    with (folder / "episodes.jsonl").open("a") as file:
        file.write('{"key": "rope_push dipac no_planning 2", "cut o')
    assert 1 <= len(before) < 3
    assert main(["evaluate", *SHORT, "-o", str(folder)]) == 0
    lines = (folder / "episodes.jsonl").read_text().splitlines()
    whole = [json.loads(line) for line in lines if "cut o" not in line]
    assert whole[: len(before)] == before
    assert sorted(row["seed"] for row in whole) == [0, 1, 2]
    for row in whole:
        assert {"task", "planner", "ablation", "seed", "chamfer_m2", "success", "reward", "decision_s"} <= row.keys()
        assert row["failure"] == ""
        assert row["chamfers_m2"][-1] == row["chamfer_m2"] != row["chamfers_m2"][0]
    assert "| dipac, no planning | 3 | 0 |" in (folder / "table.md").read_text()
    assert (folder / "rope_push@rods-chamfer.svg").exists()
    said = capsys.readouterr().out
    assert "rope_push@rods dipac no_planning" in said
    # Once more, there is nothing to play, and what stands there is told with the same numbers.
    table = (folder / "table.md").read_text()
    assert main(["evaluate", *SHORT, "-o", str(folder)]) == 0
    assert (folder / "table.md").read_text() == table
    # Other options would mix what cannot be compared.
    assert main(["evaluate", *SHORT, "--actions", "2", "-o", str(folder)]) == UsageError.exit_code
    assert "holds episodes with actions 1, not 2" in capsys.readouterr().err.replace("\n", " ")
    assert main(["evaluate", *SHORT, "--world", "cable", "-o", str(folder)]) == UsageError.exit_code
    assert "holds episodes with world chain, not cable" in capsys.readouterr().err.replace("\n", " ")
    # Nor may another planner's: their rows would stand in the same table.
    other = ["evaluate", "--task", "rope_push", "--planner", "cem_mpc", "--preset", "cpu", "--eyes", "truth"]
    assert main([*other, "--actions", "2", "-o", str(folder)]) == UsageError.exit_code
    assert "holds episodes with actions 1, not 2" in capsys.readouterr().err.replace("\n", " ")


@pytest.mark.slow
def test_an_episode_whose_process_was_lost_is_played_again(folder: Path) -> None:
    once = [*SHORT[:-1], "1", "-o", str(folder)]
    assert main(["evaluate", *once]) == 0
    (played,) = rows(folder)
    lost = played | {"lost": True, "failure": "its process was killed", "chamfer_m2": None, "success": False}
    (folder / "episodes.jsonl").write_text(json.dumps(lost) + "\n")
    assert main(["evaluate", *once]) == 0
    again = rows(folder)
    assert [row.get("lost", False) for row in again] == [True, False]
    assert again[1]["chamfers_m2"] == played["chamfers_m2"]
    assert "| dipac, no planning | 1 | 0 |" in (folder / "table.md").read_text()


def extended(path: Path, task: str = "rope_push@rods") -> Path:
    """The file of a model with effects along the rope."""
    save_model(path, model_with(task, stiffness_slope=0.6, stiffness_bow=0.3))
    return path


def test_a_given_model_is_of_the_task_and_no_other_than_the_results_are_of(
    folder: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    order = ["evaluate", *SHORT, "-o", str(folder)]
    assert main([*order, "--model", str(extended(tmp_path / "mpm.toml", "rope_push"))]) == UsageError.exit_code
    assert "is a model of task 'rope_push'" in capsys.readouterr().err.replace("\n", " ")
    hard = [*order, "--problems", "hard", "--model", str(tmp_path / "mpm.toml")]
    assert main(hard) == UsageError.exit_code
    assert "not of 'rope_push-hard@rods'; give --dynamics mpm" in capsys.readouterr().err.replace("\n", " ")
    assert main([*order, "--model", str(extended(tmp_path / "rods.toml"))]) == UsageError.exit_code
    assert "is another model than" in capsys.readouterr().err.replace("\n", " ")
    assert not (folder / "episodes.jsonl").exists()


def test_two_evaluations_do_not_write_to_one_folder(folder: Path, capsys: pytest.CaptureFixture[str]) -> None:
    with results_log.folder_lock(folder):
        assert main(["evaluate", *SHORT, "-o", str(folder)]) == UsageError.exit_code
    assert "Another evaluation writes to" in capsys.readouterr().err.replace("\n", " ")
    assert not (folder / "episodes.jsonl").exists()


@pytest.mark.parametrize(
    "wrong",
    [
        ["--task", "rope_pull"],
        ["--task", "rope_push-hard", "--problems", "easy"],
        ["--planner", "dipack"],
        ["--ablation", "no_hope"],
        ["--task", "rope_push", "--ablation", "no_online"],
        ["--task", "bean_sweep", "--ablation", "no_remainder"],
        ["--planner", "cem_mpc", "--ablation", "no_policy"],
        ["--seeds", "0"],
        ["--jobs", "0"],
        ["--actions", "0"],
        ["--task", "bean_sweep", "--planner", "dipac", "--world", "cable"],
    ],
)
def test_an_impossible_order_is_refused_before_anything_is_played(
    wrong: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert main(["evaluate", *wrong, "--preset", "cpu", "-o", str(tmp_path / "new")]) == UsageError.exit_code
    assert wrong[-1] in capsys.readouterr().err
    assert not (tmp_path / "new").exists()


def sealed(folder: Path, effect: str) -> Path:
    path = folder / "truth.json"
    hidden = draw([InjectionRequest(effect, None)], 5, Rope)
    path.write_text(json.dumps({"task": "rope_push", "seed": 5, "effects": describe(hidden)}))
    return path


@pytest.mark.serial
def test_a_world_that_hides_something_is_played_in_and_mixed_with_no_other(
    folder: Path, tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    played = [*POLICY, "--eyes", "truth", "--actions", "1", "--seeds", "1", "-o", str(folder)]
    truth = sealed(tmp_path_factory.mktemp("sealed"), "under_reach")
    assert main(["evaluate", *played, "--hidden", str(truth)]) == 0
    (row,) = rows(folder)
    assert row["failure"] == ""
    assert row["hidden"].startswith("under_reach ")
    assert str(truth) not in json.dumps(row)  # Its content counts, wherever it lies.
    assert main(["evaluate", *played]) == UsageError.exit_code
    assert "holds episodes with hidden under_reach" in capsys.readouterr().err.replace("\n", " ")


def test_errors_of_cameras_are_played_with_cameras(
    folder: Path, tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = sealed(tmp_path_factory.mktemp("sealed"), "hand_eye_translation")
    assert main(["evaluate", *SHORT, "-o", str(folder), "--hidden", str(truth)]) == UsageError.exit_code
    assert "hides hand_eye_translation, which images alone have" in capsys.readouterr().err.replace("\n", " ")
    assert not (folder / "episodes.jsonl").exists()


def test_a_delay_of_images_is_not_played_where_all_that_is_looked_at_is_at_rest(
    folder: Path, tmp_path_factory: pytest.TempPathFactory, capsys: pytest.CaptureFixture[str]
) -> None:
    truth = sealed(tmp_path_factory.mktemp("sealed"), "camera_time_offset")
    assert main(["evaluate", *SHORT, "-o", str(folder), "--hidden", str(truth)]) == UsageError.exit_code
    assert "hides camera_time_offset, which does nothing here" in capsys.readouterr().err.replace("\n", " ")
