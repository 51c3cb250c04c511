"""Collections that are resumed: with the same set-up, or a sentence that names what differs."""

import json
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.core.errors import RecordingError, UsageError
from app.core.geometry.object_description import KEY, ObjectDescription
from app.core.messages import Episode, Frame, Message, Parameter, fresh_id
from app.evaluation import demonstrate
from app.recording.read.reader import read_cameras, read_episode
from app.rig.simulated.cameras.cameras import table_cameras
from app.services.same_setup import CollectionSetup, differences, earlier_collection, require_same
from tests.recording.samples import Maker, record
from tests.ui.test_whole_cell import address, heeding_interrupts, started

__all__ = ["heeding_interrupts"]

GREEN = 'kind = "rope"\ncolour = "#1a8033"\n'


def setup(**config: object) -> CollectionSetup:
    episode = Episode(
        id=fresh_id("episode"),
        time_s=0.0,
        task=str(config.pop("task", "rope_push")),
        rig=str(config.pop("rig", "simulated")),
        seed=0,
        simulated=True,
        code_version="",
        config=json.dumps(config),
    )
    return CollectionSetup.of_episode(episode, table_cameras())


@pytest.mark.parametrize(
    ("other", "said"),
    [
        ({"task": "bean_sweep"}, "the task was rope_push, and is bean_sweep"),
        ({"rig": "gen3"}, "the cell was simulated, and is gen3"),
        ({"world": "cable"}, 'the world of the simulated rope was "chain", and is "cable"'),
        ({"table": {"turn_deg": 3.0}}, "the pose of the table was"),
        ({"limits": {"workspace": {"low": [0, 0, 0]}}}, "the workspace was"),
        (
            {KEY: ObjectDescription(kind="rope", colour=(0.1, 0.5, 0.2)).as_json},
            "the object was the task's, and is a described rope",
        ),
        ({KEY: ObjectDescription(name="cord").as_json}, "the object was the task's, and is 'cord'"),
        ({"preset": "gpu"}, 'the preset was "cpu", and is "gpu"'),
        ({"options": {"preset": "auto"}}, ""),
    ],
)
def test_what_differs_is_named(other: dict[str, object], said: str) -> None:
    usual = {
        "world": "chain",
        "preset": "cpu",
        "table": {"turn_deg": 0.0},
        "limits": {"workspace": {"low": [0.2, 0, 0]}},
    }
    before = setup(**usual)
    assert not list(differences(before, setup(**usual)))
    now = setup(**(usual | other))
    assert said in "; ".join(differences(before, now))
    if not said:
        assert not list(differences(before, now))
        return
    with pytest.raises(UsageError, match="Set it up as it was"):
        require_same(before, now, Path("recordings"))


def test_of_two_objects_what_differs_is_named() -> None:
    friction = Parameter(name="table_friction", value=0.3, unit="1", low=0.2, high=0.5)
    cord = ObjectDescription(kind="rope", name="cord", sizes={"mass_kg": 0.05}, colour=(0.1, 0.5, 0.2))
    other = replace(cord, sizes={"mass_kg": 0.06}, colour=(0.5, 0.2, 0.1), priors=(friction,))
    before, now = setup(**{KEY: cord.as_json}), setup(**{KEY: other.as_json})
    assert list(differences(before, now)) == [
        "the object's colour was (0.1, 0.5, 0.2), and is (0.5, 0.2, 0.1)",
        "the object's range of colours was hue 117 to 153 degrees, and is hue 357 to 33 degrees",
        "the object's priors was the task's, and is table_friction 0.2 to 0.5",
        "the object's mass_kg was 0.05, and is 0.06",
    ]


def test_cameras_that_moved_or_look_otherwise_are_named() -> None:
    before, (left, right) = setup(), table_cameras()
    moved, turned = left.T_world_camera.copy(), left.T_world_camera.copy()
    moved[0, 3] += 0.012
    angle = np.radians(2.0)
    turned[:2, :2] = np.array([[np.cos(angle), -np.sin(angle)], [np.sin(angle), np.cos(angle)]]) @ turned[:2, :2]
    lens = left.K * np.array([[1.01], [1.01], [1.0]])
    for camera, said in (
        (replace(left, T_world_camera=moved), "stands 12 mm elsewhere, turned by 0.0 degrees"),
        (replace(left, T_world_camera=turned), "elsewhere, turned by"),
        (replace(left, K=lens), "is calibrated otherwise"),
        (replace(left, width=1280), "had 640 x 480 pixels"),
        (replace(left, name="other"), "'camera0' is missing; camera 'other' was not there"),
    ):
        found = "; ".join(differences(before, replace(before, cameras=(camera, right))))
        assert said.replace("640 x 480", f"{left.width} x {left.height}").replace("camera0", left.name) in found
    assert not list(differences(before, replace(before, cameras=None)))
    nowhere = replace(left, T_world_camera=np.full((4, 4), np.nan))
    assert "nobody knows where camera" in "; ".join(differences(before, replace(before, cameras=(nowhere, right))))


@pytest.fixture
def short(monkeypatch: pytest.MonkeyPatch) -> None:
    """One action an episode."""
    orders = demonstrate.EvaluationConfig

    def order(**said: object) -> demonstrate.EvaluationConfig:
        return orders(**{**said, "actions": 1})  # pyright: ignore[reportArgumentType]

    monkeypatch.setattr(demonstrate, "EvaluationConfig", order)


@pytest.mark.usefixtures("short")
def test_a_collection_goes_on_in_another_session_with_the_same_object_and_no_other(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    (tmp_path / "green.toml").write_text(GREEN)
    folder = tmp_path / "shown"
    order = ["collect", "rope_push", "--preset", "cpu", "-o", str(folder), "--object", str(tmp_path / "green.toml")]
    assert main([*order, "--episodes", "1"]) == 0
    (path,) = folder.glob("*.mcap")
    episode = read_episode(path)
    assert episode.task == "rope_push"
    assert json.loads(episode.config)[KEY]["kind"] == "rope"
    assert [camera.name for camera in read_cameras(path)] == [camera.name for camera in table_cameras()]
    assert main([*order, "--episodes", "2", "--resume"]) == 0
    assert sorted(read_episode(each).seed for each in folder.glob("*.mcap")) == [1000, 1001]
    assert "holds 1 recordings of this set-up" in capsys.readouterr().out
    # Nothing is left to do, and nothing is done.
    assert main([*order, "--episodes", "2", "--resume"]) == 0
    (tmp_path / "green.toml").write_text(GREEN.replace("#1a8033", "#803a1a") + "mass_kg = 0.05\n")
    assert main([*order, "--episodes", "3", "--resume"]) == UsageError.exit_code
    said = capsys.readouterr().err
    for clause in ("the task was rope_push, and is rope_push(mass_kg=0.05)", "the object's colour was"):
        assert clause in said
    assert main([*order, "--episodes", "3", "--resume", "-o", str(tmp_path / "none")]) == UsageError.exit_code
    assert "leave --resume out" in capsys.readouterr().err
    assert len(list(folder.glob("*.mcap"))) == 2


def recorded(folder: Path, task: str) -> Path:
    """A recording of a task in the simulated cell, with an image of each camera."""
    make = Maker(seed=1)
    episode = make(Episode, cause=(), task=task, rig="simulated", config="{}")
    images: list[Message] = [make(Frame, cause=(), camera=camera) for camera in table_cameras()]
    return record(folder, episode, images)


def cut_off(whole: Path) -> Path:
    """The beginning of a recording, as one that is still being written lies there."""
    path = whole.with_name("cut.mcap")
    path.write_bytes(whole.read_bytes()[:-40])
    return path


def test_recordings_of_other_tasks_and_cut_off_ones_are_left_out_and_named(tmp_path: Path) -> None:
    kept = recorded(tmp_path, "rope_push")
    other, cut = recorded(tmp_path, "bean_sweep"), cut_off(kept)
    found = earlier_collection(tmp_path, "rope_push@rods")
    assert (found.paths, found.setup.task) == ((kept,), "rope_push")
    said = " ".join(found.skipped)
    assert len(found.skipped) == 2
    assert f"{other} is of bean_sweep" in said
    assert f"{cut} is cut off, or still being written" in said
    # The same task of another size is another set-up.
    recorded(tmp_path, "rope_push(mass_kg=0.05)")
    with pytest.raises(RecordingError, match="of two set-ups already: the task"):
        earlier_collection(tmp_path, "rope_push")


def test_where_no_recording_of_the_task_is_left_there_is_nothing_to_go_on_from(tmp_path: Path) -> None:
    cut = cut_off(recorded(tmp_path, "bean_sweep"))
    with pytest.raises(UsageError, match="holds no recording of rope_push to go on from") as refused:
        earlier_collection(tmp_path, "rope_push")
    assert "\n" not in str(refused.value)
    # One file is read, or refused.
    with pytest.raises(RecordingError, match="cut off"):
        earlier_collection(cut, "rope_push")
    assert earlier_collection(next(tmp_path.glob("*bean*.mcap")), "rope_push").setup.task == "bean_sweep"


@pytest.mark.serial
@pytest.mark.usefixtures("heeding_interrupts")
def test_a_console_goes_on_with_the_folder_in_which_it_records(tmp_path: Path) -> None:
    kept = recorded(tmp_path, "rope_push")
    cut_off(kept)
    options = ("--port", 0, "--preset", "cpu", "--no-calibrate", "--recordings", tmp_path, "--resume", tmp_path)
    with started("console", "rope_push", *options) as console:
        assert address(console).startswith("http")
    assert len(list(tmp_path.glob("*.mcap"))) == 3
