"""`dipac hide`: whole recordings that say nothing of what is hidden, and a sealed file that says all."""

import hashlib
import json
import stat
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.core.errors import ParameterError, UsageError
from app.core.messages import Episode, Executed, Frame, Particles, Sighting, Transition
from app.recording.format.integrity import inspect
from app.recording.read.reader import read_messages, read_transitions
from app.rig.simulated.effect_sampling import injectable_effects
from app.services.study import read_study

SEED = 730915
SMALL = ["--seed", str(SEED), "--episodes", "2", "--pushes", "1"]
HIDDEN = ["depth_bias=0.01", "table_tilt"]


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("hide") / "session"
    assert main(["hide", *HIDDEN, *SMALL, "-o", str(folder)]) == 0
    return folder


def truth(folder: Path) -> dict:
    return json.loads(folder.with_name(f"{folder.name}.truth.json").read_text())


def recordings(folder: Path) -> list[Path]:
    return sorted(folder.iterdir())


def test_recordings_are_whole_and_hold_pushes_that_discovery_and_calibration_read(folder: Path) -> None:
    assert [path.name for path in recordings(folder)] == ["episode-01.mcap", "episode-02.mcap"]
    for path in recordings(folder):
        inspect(path)
        (transition,) = read_transitions(path)
        assert transition.before.shape == transition.after.shape == (300, 3)
    study = read_study(recordings(folder))
    assert [push.episode for push in study.pushes] == [0, 1]
    assert study.session_times() == pytest.approx([-0.5, 0.5])
    for push in study.pushes:
        assert len(push.during) == 1
        assert push.measured is not None
        assert push.before.time_s < push.command.times_s[0] < push.command.times_s[-1] < push.after.time_s
    assert sorted(study.tables) == [0, 1]


def test_what_was_hidden_in_the_cameras_is_in_the_recordings(folder: Path) -> None:
    """Depth that is too long by a centimetre puts the table below zero."""
    study = read_study(recordings(folder))
    bias = truth(folder)["effects"][0]["parameters"]["depth_bias"]["value"]
    height = np.mean([table[:, 2].mean() for table in study.tables.values()])
    assert abs(bias) == 0.01
    assert height == pytest.approx(-bias * 0.8, abs=0.002)


def test_no_byte_of_a_recording_tells_what_is_hidden(folder: Path) -> None:
    told = [str(SEED), "seed-", "hidden", "truth", *injectable_effects()]
    told += [quantity.name for effect in injectable_effects().values() for quantity in effect.quantities]
    for path in recordings(folder):
        # Chunks are compressed; their channels' bytes are read apart.
        contents = [path.read_bytes(), *raw(path)]
        assert not [word for word in told if any(word.encode() in content for content in contents)]


def raw(path: Path) -> list[bytes]:
    from mcap.reader import make_reader

    with path.open("rb") as stream:
        reader = make_reader(stream)
        metadata = [json.dumps(record.metadata).encode() for record in reader.iter_metadata()]
        return metadata + [message.data for _, channel, message in reader.iter_messages()]


def test_every_session_begins_at_the_same_time_with_the_same_words(folder: Path) -> None:
    for number, path in enumerate(recordings(folder)):
        messages = list(read_messages(path, [Episode, Frame, Particles, Sighting, Executed, Transition]))
        episode = messages[0]
        assert isinstance(episode, Episode)
        assert (episode.seed, episode.simulated, episode.rig) == (0, True, "simulated")
        assert json.loads(episode.config) == {"preset": "cpu", "pushes": 1}
        assert episode.time_s == pytest.approx(1000.0 + 8.0 * number)
        assert len([message for message in messages if isinstance(message, Frame)]) == 2
        assert all(message.reconstruction_s == 0.0 for message in messages if isinstance(message, Particles))


def test_the_truth_is_sealed_outside_and_names_effects_world_and_recordings(folder: Path) -> None:
    sealed = folder.with_name(f"{folder.name}.truth.json")
    assert stat.S_IMODE(sealed.stat().st_mode) == 0o400
    said = truth(folder)
    assert said["seed"] == SEED
    assert [each["effect"] for each in said["effects"]] == ["depth_bias", "table_tilt"]
    tilt = said["effects"][1]["parameters"]
    assert np.hypot(tilt["tilt_x"]["value"], tilt["tilt_y"]["value"]) == pytest.approx(1.0)
    assert said["world"]["table_friction"] == pytest.approx(0.5, rel=0.3)
    digests = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in recordings(folder)}
    assert said["recordings"] == digests


@pytest.mark.serial
def test_another_process_makes_the_same_bytes_of_the_same_seed_and_other_pushes_of_another(
    folder: Path, tmp_path: Path
) -> None:
    again, other = tmp_path / "again", tmp_path / "other"
    command = [sys.executable, "-m", "app", "hide", *HIDDEN, *SMALL, "-o", str(again)]
    subprocess.run(command, check=True, capture_output=True)
    assert truth(again)["recordings"] == truth(folder)["recordings"]
    assert main(["hide", "--seed", "4", "--episodes", "1", "--pushes", "1", "-o", str(other)]) == 0
    first, second = (read_transitions(recordings(each)[0])[0] for each in (folder, other))
    assert not np.array_equal(first.before, second.before)
    assert truth(other)["effects"] == []


def test_a_cable_moves_otherwise_and_hides_what_is_in_arm_and_cameras(tmp_path: Path) -> None:
    order = ["hide", "depth_bias=0.01", "--seed", str(SEED), "--episodes", "1", "--pushes", "1"]
    for world in ("chain", "cable"):
        assert main([*order, "--world", world, "-o", str(tmp_path / world)]) == 0
    chain, cable = (truth(tmp_path / world) for world in ("chain", "cable"))
    assert chain["effects"] == cable["effects"]
    assert chain["world"].keys() - cable["world"].keys() == {"bend_stiffness_n_m_rad"}
    assert cable["world"]["rigidity_n_m2"] == pytest.approx(1.5e-5, rel=0.3)
    one, other = (read_transitions(recordings(tmp_path / world)[0])[0] for world in ("chain", "cable"))
    assert not np.array_equal(one.after, other.after)


def test_another_rope_and_finger_are_recorded_by_as_many_cameras_as_are_asked_for(tmp_path: Path) -> None:
    task = "rope_push(finger_half_width_m=0.01,finger_yaw_rad=0.6,length_m=0.5,radius_m=0.006)"
    order = ["hide", "--seed", str(SEED), "--episodes", "1", "--pushes", "1", "--task", task, "--cameras", "3"]
    assert main([*order, "--depth-noise-mm", "2.5", "-o", str(tmp_path / "other")]) == 0
    (path,) = recordings(tmp_path / "other")
    study = read_study([path])
    assert study.task == truth(tmp_path / "other")["task"] == task
    cameras = {message.camera.name for message in read_messages(path, [Frame]) if isinstance(message, Frame)}
    assert len(cameras) == 3
    cloud = study.pushes[0].before.points
    assert np.median(cloud[:, 2]) == pytest.approx(0.006, abs=0.002)


@pytest.mark.parametrize(
    ("arguments", "said", "error"),
    [
        (["--seed", "1", "--cameras", "4"], "--cameras 4 is outside 1 to 3", UsageError),
        (["--seed", "1", "--depth-noise-mm", "9"], "--depth-noise-mm 9 is outside 0.1 to 5", UsageError),
        (
            ["--seed", "1", "--task", "rod_to_rope"],
            "so far; choose another task: bean_sweep, cloth_hang, pour_soup, pour_water, rope_push",
            UsageError,
        ),
        (["cohesion", "--seed", "1"], "beans of this world do not stick together", UsageError),
        (["piece_stiffness", "--seed", "1", "--task", "pour_water"], "nothing that Liquid can have", UsageError),
        (["table_tilt=much", "--seed", "1"], "no number after its =", UsageError),
        (["table_tilt=50", "--seed", "1"], "outside 0 to 5 deg", ParameterError),
        (["table_tilt", "backlash", "--seed", "1", "--world", "cable"], "leave out table_tilt, or --world", UsageError),
        (["--seed", "-1"], "--seed -1 is negative", UsageError),
        (["--seed", "1", "--pushes", "0"], "--pushes 0 is outside 1 to 99", UsageError),
    ],
)
def test_a_wrong_order_says_what_is_wrong_before_anything_is_made(arguments, said, error, tmp_path, capsys) -> None:
    assert main(["hide", *arguments, "-o", str(tmp_path / "session")]) == error.exit_code
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())


def test_nothing_is_overwritten_and_the_truth_never_lies_with_the_recordings(folder: Path, tmp_path, capsys) -> None:
    new = tmp_path / "new"
    for arguments, said in (
        (["-o", str(folder), "--truth", str(tmp_path / "t.json")], "is not empty"),
        (["-o", str(new), "--truth", str(folder.with_name(f"{folder.name}.truth.json"))], "exists; choose another"),
        (["-o", str(new), "--truth", str(new / "t.json")], "with the recordings"),
    ):
        assert main(["hide", *SMALL, *arguments]) == UsageError.exit_code
        assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
