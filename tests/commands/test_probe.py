"""`dipac probe`: chosen pushes in the simulated cell to a report, and a recommendation from recordings."""

import json
import subprocess
import sys
from pathlib import Path

import msgspec
import numpy as np
import pytest

from app.arm.gate import refusal
from app.commands._case import MODEL, VERDICT
from app.commands._pushes import PUSHES, motions_in, read_pushes, write_pushes
from app.commands.probe import probe
from app.config import Site
from app.core.errors import RecordingError, UsageError
from app.discovery.experiments.probe_pushes import Probe
from app.policy.random_pushes import PushDesign, random_track
from app.report.schema import PushesFile, VerdictFile
from app.services.study import read_study
from app.tasks import load
from tests.planner.table import rope

ROOT = Path(__file__).parents[2]


def dipac(*arguments: str) -> str:
    """Standard output of the program."""
    command = [sys.executable, "-m", "app", *arguments]
    return subprocess.run(command, cwd=ROOT, capture_output=True, text=True, check=True).stdout


def written(folder: Path) -> Path:
    """A file of one push."""
    track = random_track(np.random.default_rng(1), rope(), PushDesign(), start_s=0.0, height_m=0.006)
    found = Probe(
        track=track,
        text="Push 10 cm",
        nats=0.5,
        between=("viscous_film", "nothing missing"),
        information=np.zeros((2, 2)),
        predicted=rope(),
    )
    path = folder / PUSHES
    write_pushes(path, "rope_push", [found])
    return path


def test_pushes_are_read_as_they_were_written_and_are_motions_that_the_gate_allows(tmp_path: Path) -> None:
    path = written(tmp_path)
    (track,) = read_pushes(path, "rope_push")
    wanted = msgspec.json.decode(path.read_bytes(), type=PushesFile).pushes[0].track
    assert track.poses.tolist() == [list(pose) for pose in wanted.poses]
    (motion,) = motions_in(path, "rope_push", "rope_push@rods", Site())
    assert refusal(motion, Site()) == ""


def test_pushes_for_another_task_or_of_no_shape_are_refused(tmp_path: Path) -> None:
    path = written(tmp_path)
    with pytest.raises(UsageError, match="is for task 'rope_push', not 'rod_to_rope'"):
        read_pushes(path, "rod_to_rope")
    plain = json.loads(path.read_text())
    plain["pushes"][0]["track"]["times_s"][0] = 1e9
    path.write_text(json.dumps(plain))
    with pytest.raises(RecordingError, match="push 1 is no way of a tool"):
        read_pushes(path, "rope_push")
    path.write_text("{}")
    with pytest.raises(RecordingError, match="holds no pushes"):
        read_pushes(path, "rope_push")
    with pytest.raises(UsageError, match="Cannot read"):
        read_pushes(tmp_path / "none.json", "rope_push")


def test_other_objects_than_ropes_are_refused_in_a_sentence(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="dipac probe pushes ropes so far, and bean_sweep is another task"):
        probe("bean_sweep", output=tmp_path / "out")
    with pytest.raises(UsageError, match="simulates ropes as rods"):
        probe("rope_push@mpm", output=tmp_path / "out")
    assert not (tmp_path / "out").exists()


def test_a_budget_that_cannot_be_is_said_before_anything_is_made(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="1 <= batch <= budget"):
        probe("rope_push", output=tmp_path / "out", budget=3, batch=4)


@pytest.mark.slow
@pytest.mark.serial
@pytest.mark.timeout(1800)
def test_pushes_are_chosen_made_recorded_and_reported_and_the_next_ones_recommended(tmp_path: Path) -> None:
    folder, ahead = tmp_path / "probing", tmp_path / "next"
    small = ["--budget", "3", "--batch", "2", "--seed", "5"]
    said = dipac("probe", "rope_push", *small, "--hide-effect", "under_reach=0.05", "-o", str(folder))
    assert said.count("next: Push ") == 3
    assert "After 2 pushes: " in said
    assert "After 3 pushes: " in said
    recordings = sorted(folder.glob("*.mcap"))
    assert [path.name for path in recordings] == ["episode-01.mcap", "episode-02.mcap"]
    study = read_study(recordings)
    assert [push.episode for push in study.pushes] == [0, 0, 1]
    for push in study.pushes:
        shift = np.linalg.norm(push.after.points - push.before.points, axis=1)
        assert shift.max() > 0.01
    msgspec.json.decode((folder / VERDICT).read_bytes(), type=VerdictFile)
    assert (folder / MODEL).exists()
    truth = json.loads((tmp_path / "probing.truth.json").read_text())
    assert [each["effect"] for each in truth["effects"]] == ["under_reach"]

    given = [str(path) for path in recordings]
    assert "1. Push " in dipac("probe", "rope_push", "--recordings", *given, "--batch", "2", "-o", str(ahead))
    tracks = read_pushes(ahead / PUSHES, "rope_push")
    assert len(tracks) == 2
    for motion in motions_in(ahead / PUSHES, "rope_push", load("rope_push@rods").name, Site()):
        assert refusal(motion, Site()) == ""
    # The first is for the rope as it lies, and meets it.
    way, lies = tracks[0].positions[:, :2], study.pushes[-1].after.points[:, :2]
    assert min(np.linalg.norm(lies - place, axis=1).min() for place in way) < 0.01
