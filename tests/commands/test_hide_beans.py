"""`dipac hide --task bean_sweep`: whole recordings of sweeps that say nothing of what is hidden."""

import hashlib
import json
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.core.errors import UsageError
from app.core.messages import Episode, Executed, Frame, Message, Particles, Sighting, Transition
from app.recording.format.integrity import inspect
from app.recording.read.reader import read_messages, read_transitions
from app.rig.simulated.effect_sampling import injectable_effects
from tests.commands.test_hide import raw, recordings, truth

SEED = 730916
SMALL = ["--task", "bean_sweep", "--seed", str(SEED), "--episodes", "2", "--pushes", "1"]


def hidden(folder: Path, *effects: str) -> Path:
    assert main(["hide", *effects, *SMALL, "-o", str(folder)]) == 0
    return folder


@pytest.fixture(scope="module")
def control(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return hidden(tmp_path_factory.mktemp("hide") / "control")


@pytest.fixture(scope="module")
def rough(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Sessions whose paddle is rough, which shows in nothing before the first sweep."""
    return hidden(tmp_path_factory.mktemp("hide") / "session", "finger_friction=1")


def messages(path: Path) -> list[Message]:
    return list(read_messages(path, [Episode, Frame, Particles, Sighting, Executed, Transition]))


def test_recordings_are_whole_and_hold_sweeps(control: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert [path.name for path in recordings(control)] == ["episode-01.mcap", "episode-02.mcap"]
    for number, path in enumerate(recordings(control)):
        inspect(path)
        (transition,) = read_transitions(path)
        assert transition.before.shape == transition.after.shape == (300, 3)
        assert np.linalg.norm(transition.after - transition.before, axis=1).max() > 0.01
        episode = messages(path)[0]
        assert isinstance(episode, Episode)
        assert (episode.task, episode.seed, episode.rig) == ("bean_sweep", 0, "simulated")
        assert episode.time_s == pytest.approx(1000.0 + 8.0 * number)
        tools = [each.tool for each in messages(path) if isinstance(each, Sighting) and len(each.tool)]
        (executed,) = (each for each in messages(path) if isinstance(each, Executed))
        (tool,) = tools
        assert np.linalg.norm(executed.measured[:, :3] - tool.mean(0), axis=1).min() < 0.005
        assert any(len(each.table) > 300 for each in messages(path) if isinstance(each, Sighting))
    paths = [str(path) for path in recordings(control)]
    assert main(["recordings", "check", *paths]) == 0
    assert main(["recordings", "show", paths[0]]) == 0
    assert "bean_sweep" in capsys.readouterr().out


def test_the_truth_names_effects_world_and_recordings(rough: Path) -> None:
    said = truth(rough)
    assert [each["effect"] for each in said["effects"]] == ["finger_friction"]
    assert said["task"] == "bean_sweep"
    assert said["world"]["beans"] == 50
    assert said["world"]["table_friction"] == pytest.approx(0.4, rel=0.3)
    assert said["world"]["rolling_m"] == pytest.approx(5e-4, rel=0.3)
    digests = {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in recordings(rough)}
    assert said["recordings"] == digests


def test_no_byte_of_a_recording_tells_what_is_hidden(rough: Path) -> None:
    told = [str(SEED), "seed-", "hidden", "truth", *injectable_effects()]
    told += [quantity.name for effect in injectable_effects().values() for quantity in effect.quantities]
    for path in recordings(rough):
        contents = [path.read_bytes(), *raw(path)]
        assert not [word for word in told if any(word.encode() in content for content in contents)]


def test_a_control_and_a_hidden_effect_differ_in_what_was_seen_alone(control: Path, rough: Path) -> None:
    """All is alike but particles and points of tool and table; those before a first sweep are alike, too."""
    for path, other in zip(recordings(control), recordings(rough), strict=True):
        pairs = list(zip(messages(path), messages(other), strict=True))
        assert [type(one) for one, _ in pairs] == [type(two) for _, two in pairs]
        assert [one.id for one, _ in pairs] == [two.id for _, two in pairs]
        assert [one.time_s for one, _ in pairs] == pytest.approx([two.time_s for _, two in pairs])
        for one, two in pairs:
            if isinstance(one, Executed) and isinstance(two, Executed):
                assert np.array_equal(one.commanded, two.commanded)
                assert np.array_equal(one.measured, two.measured)
            if isinstance(one, Frame) and isinstance(two, Frame):
                assert np.array_equal(one.depth, two.depth)
    one, two = (read_transitions(recordings(each)[0])[0] for each in (control, rough))
    assert np.array_equal(one.before, two.before)
    assert not np.array_equal(one.after, two.after)


@pytest.mark.serial
def test_another_process_makes_the_same_bytes_of_the_same_seed(rough: Path, tmp_path: Path) -> None:
    again = tmp_path / "again"
    command = [sys.executable, "-m", "app", "hide", "finger_friction=1", *SMALL, "-o", str(again)]
    subprocess.run(command, check=True, capture_output=True)
    assert json.dumps(truth(again)["recordings"]) == json.dumps(truth(rough)["recordings"])


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["maxwell"], "maxwell is nothing that Beans can have. What can be hidden: abrupt_change, "),
        (["--world", "cable"], "--world cable is of tasks with a rope, not of bean_sweep"),
        (["cohesion"], "cohesion cannot be hidden"),
    ],
)
def test_a_wrong_order_says_what_is_wrong_before_anything_is_made(arguments, said, tmp_path, capsys) -> None:
    assert main(["hide", *arguments, *SMALL, "-o", str(tmp_path / "session")]) == UsageError.exit_code
    assert said in capsys.readouterr().err
    assert not list(tmp_path.iterdir())
