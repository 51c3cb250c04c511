"""A dataset in LeRobot's format: read by the package that LeRobot itself reads it with, and true to the recording."""

import importlib
import io
import json
from dataclasses import replace
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np
import PIL.Image
import pytest

from app.core.errors import PreflightError, RecordingError, UsageError
from app.core.messages import Episode, Executed, Frame, Goal, Particles, fresh_id
from app.recording.exchange.lerobot.dataset import export
from app.recording.exchange.lerobot.depth_image import tiff_depth
from app.recording.exchange.lerobot.samples import sample
from app.recording.library.label import Label, relabel
from app.recording.read.reader import read_messages, read_pictures
from tests.recording.demonstrations import PARTICLES, PUSHES, demonstration
from tests.recording.samples import record

# Imported by who needs it alone: all processes of tests collect this file, and the package takes as long as JAX.
pytestmark = pytest.mark.skipif(
    find_spec("datasets") is None, reason="The package `datasets` is missing; install dipac[lerobot]."
)
FPS = 10
STEPS = PUSHES * FPS
IMAGES = ("observation.images.camera0", "observation.images.camera1")
DEPTHS = tuple(f"{name}_depth" for name in IMAGES)


@pytest.fixture(scope="module")
def paths(tmp_path_factory: pytest.TempPathFactory) -> list[Path]:
    folder = tmp_path_factory.mktemp("shown")
    found = [demonstration(folder, seed=seed) for seed in range(3)]
    relabel(found[1], Label.now("success", note="", operator=""))
    return found


@pytest.fixture(scope="module")
def root(paths: list[Path], tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("dataset") / "new"
    # Cameras of these recordings differ, so nothing says where they are.
    assert export(paths, folder, fps=FPS) == (3, 3 * STEPS, False)
    return folder


@pytest.fixture(scope="module")
def rows(root: Path, tmp_path_factory: pytest.TempPathFactory) -> Any:
    files = [str(path) for path in sorted((root / "data").glob("*/*.parquet"))]
    return importlib.import_module("datasets").Dataset.from_parquet(
        files, cache_dir=str(tmp_path_factory.mktemp("cache"))
    )


def told(root: Path, name: str) -> Any:
    return json.loads((root / "meta" / name).read_text())


def test_the_files_are_those_of_the_format(root: Path) -> None:
    found = {str(path.relative_to(root)) for path in root.rglob("*") if path.is_file()}
    assert found == {
        "meta/info.json",
        "meta/stats.json",
        "meta/tasks.parquet",
        "meta/episodes/chunk-000/file-000.parquet",
        "data/chunk-000/file-000.parquet",
    }


def test_images_that_several_steps_show_are_kept_once(root: Path, paths: list[Path]) -> None:
    shown = 2 * PUSHES  # Of each camera those before each push; those after the last are of no step.
    pictures = [picture for path in paths for picture in list(read_pictures(path))[:shown]]
    stored = sum(path.stat().st_size for path in (root / "data").rglob("*.parquet"))
    assert stored < 1.1 * sum(len(picture.jpeg) + len(picture.depth) for picture in pictures)


def test_the_description_counts_what_is_there(root: Path, rows: Any) -> None:
    info = told(root, "info.json")
    assert info["codebase_version"] == "v3.0"
    assert (info["total_episodes"], info["total_frames"], info["total_tasks"]) == (3, len(rows), 1)
    assert (info["fps"], info["splits"]) == (FPS, {"train": "0:3"})
    assert set(info["features"]) == set(rows.column_names)
    assert info["features"]["observation.state"]["names"][-1] == "opening"
    assert info["features"][IMAGES[0]] == {
        "dtype": "image",
        "shape": [480, 640, 3],
        "names": ["height", "width", "channels"],
    }
    assert info["features"][DEPTHS[1]] == {
        "dtype": "image",
        "shape": [480, 640, 1],
        "names": ["height", "width", "channels"],
        "info": {"is_depth_map": True, "depth_unit": "mm"},
    }
    path = info["data_path"].format(chunk_index=0, file_index=0)
    assert (root / path).is_file()


def test_steps_are_counted_as_the_format_counts_them(rows: Any) -> None:
    numbers = rows.select_columns(["index", "episode_index", "frame_index", "timestamp", "task_index"]).with_format(
        "numpy"
    )[:]
    assert numbers["index"].tolist() == list(range(3 * STEPS))
    assert numbers["episode_index"].tolist() == np.repeat(range(3), STEPS).tolist()
    assert numbers["frame_index"].tolist() == list(range(STEPS)) * 3
    # LeRobot wants steps 1 / fps apart to 1e-4 s.
    assert np.abs(numbers["timestamp"] - numbers["frame_index"] / FPS).max() < 1e-4
    assert set(numbers["task_index"].tolist()) == {0}


def test_the_tool_the_object_and_the_goal_are_those_of_the_recording(paths: list[Path], rows: Any) -> None:
    said = list(read_messages(paths[1], [Executed, Particles, Goal]))
    made = [message for message in said if isinstance(message, Executed)]
    seen = [message for message in said if isinstance(message, Particles)]
    own = rows.select(range(STEPS, 2 * STEPS)).remove_columns([*IMAGES, *DEPTHS]).with_format("numpy")[:]
    for push, executed in enumerate(made):
        part = slice(push * FPS, (push + 1) * FPS)
        assert np.allclose(own["observation.state"][part, :7], executed.measured[:-1:10], atol=1e-6)
        assert np.allclose(own["action"][part, :7], executed.commanded[10::10], atol=1e-6)
        assert np.array_equal(own["observation.environment_state"][push * FPS], seen[push].positions.ravel())
    goal = next(message for message in said if isinstance(message, Goal))
    assert np.array_equal(own["observation.goal"][3], goal.positions.ravel())
    assert own["next.done"].nonzero()[0].tolist() == [STEPS - 1]
    assert own["next.success"].nonzero()[0].tolist() == [STEPS - 1]
    assert not rows.select(range(STEPS)).with_format("numpy")["next.success"][:].any()


def test_a_goal_that_is_set_in_between_is_that_of_the_steps_after_it(tmp_path: Path) -> None:
    said = list(read_messages(demonstration(tmp_path)))
    executed = [message for message in said if isinstance(message, Executed)]
    goal = next(message for message in said if isinstance(message, Goal))
    later = replace(goal, id=fresh_id("goal"), time_s=executed[-1].times_s[0] - 0.01, positions=goal.positions + 0.1)
    episode = next(message for message in said if isinstance(message, Episode))
    others = [message for message in said if isinstance(message, Goal | Particles | Frame | Executed)]
    samples = sample(record(tmp_path, episode, [*others, later]), FPS)
    last = samples.goal[:, 0, 0] == later.positions[0, 0]
    steps = round((executed[-1].times_s[-1] - executed[-1].times_s[0]) * FPS)
    assert last.tolist() == [False] * (len(samples) - steps) + [True] * steps
    assert np.array_equal(samples.goal[0], goal.positions)


def test_images_are_the_newest_of_the_recording_byte_by_byte(paths: list[Path], rows: Any) -> None:
    raw = rows.cast_column(IMAGES[1], importlib.import_module("datasets").Image(decode=False))
    pictures = [picture for picture in read_pictures(paths[0]) if picture.camera.name == "camera1"]
    for step in (0, FPS - 1, FPS, STEPS - 1):
        assert raw[step][IMAGES[1]]["bytes"] == pictures[step // FPS].jpeg
    assert rows[0][IMAGES[1]].size == (640, 480)


def test_depth_is_the_newest_of_the_recording_without_loss(paths: list[Path], rows: Any) -> None:
    frames = [frame for frame in read_messages(paths[0], [Frame]) if isinstance(frame, Frame)]
    of_one = [frame for frame in frames if frame.camera.name == "camera1"]
    for step in (0, FPS - 1, FPS, STEPS - 1):
        depth = np.asarray(rows[step][DEPTHS[1]])
        assert depth.dtype == np.uint16
        assert np.array_equal(depth, of_one[step // FPS].depth)


def test_depth_in_other_steps_than_millimetres_becomes_metres(tmp_path: Path) -> None:
    path = demonstration(tmp_path, depth_unit_m=0.00025)
    images = sample(path, FPS).images["camera0"]
    assert images.depth_unit == "m"
    frame = next(it for it in read_messages(path, [Frame]) if isinstance(it, Frame))
    metres = tiff_depth(images.depth[0])
    assert metres.dtype == np.float32
    assert np.array_equal(metres, (frame.depth * 0.00025).astype(np.float32))


@pytest.mark.parametrize("first_m", [0.001, 0.0001])
def test_a_camera_that_changes_its_unit_of_depth_has_one_in_the_dataset(first_m: float, tmp_path: Path) -> None:
    said = list(read_messages(demonstration(tmp_path / "one")))
    episode = next(message for message in said if isinstance(message, Episode))
    kept = [message for message in said if isinstance(message, Goal | Particles | Frame | Executed)]
    frames = [message for message in kept if isinstance(message, Frame) and message.camera.name == "camera0"]
    other_m = 0.001 + 0.0001 - first_m
    turned = {
        frame.id: replace(frame, camera=replace(frame.camera, depth_unit_m=other_m if number % 2 else first_m))
        for number, frame in enumerate(frames)
    }
    path = record(tmp_path / "two", episode, [turned.get(message.id, message) for message in kept])
    samples = sample(path, FPS)
    images = samples.images["camera0"]
    assert (images.depth_unit, samples.images["camera1"].depth_unit) == ("m", "mm")
    assert images.camera is not None, "its place and its optics are the same"
    for push, frame in enumerate(turned.values()):
        if push < PUSHES:
            depth = tiff_depth(images.depth[push * FPS])
            assert depth.dtype == np.float32
            assert np.array_equal(depth, (frame.depth * frame.camera.depth_unit_m).astype(np.float32))
    # Images that several steps show are still one.
    assert len(set(images.depth)) == PUSHES


def test_images_without_any_reading_of_depth_have_none_in_the_dataset(tmp_path: Path) -> None:
    path = demonstration(tmp_path / "with")
    said = list(read_messages(path))
    episode = next(message for message in said if isinstance(message, Episode))
    blind = [
        replace(message, depth=np.zeros_like(message.depth)) if isinstance(message, Frame) else message
        for message in said
        if isinstance(message, Goal | Particles | Frame | Executed)
    ]
    without = record(tmp_path / "without", episode, blind)
    assert sample(without, FPS).images["camera0"].depth == []
    with pytest.raises(RecordingError, match="no depth"):
        export([path, without], tmp_path / "new", fps=FPS)


def test_a_rest_shows_what_came_of_each_motion(paths: list[Path]) -> None:
    rest_s = 0.5
    samples = sample(paths[0], FPS, rest_s)
    resting = round(rest_s * FPS)
    assert len(samples) == STEPS + PUSHES * resting
    seen = [it.positions for it in read_messages(paths[0], [Particles]) if isinstance(it, Particles)]
    pictures = [it.jpeg for it in read_pictures(paths[0]) if it.camera.name == "camera0"]
    for push in range(PUSHES):
        own = slice(push * (FPS + resting) + FPS, (push + 1) * (FPS + resting))
        assert np.array_equal(samples.object[own], np.repeat(seen[push + 1][None], resting, 0))
        assert set(samples.images["camera0"].jpeg[own]) == {pictures[push + 1]}
        # The arm stands where it ended, and is told to.
        assert np.ptp(samples.state[own], axis=0).max() == 0
        assert np.ptp(samples.action[own], axis=0).max() == 0


def test_episodes_say_where_their_steps_are_and_tasks_what_they_are_called(root: Path) -> None:
    import pandas

    episodes = pandas.read_parquet(root / "meta/episodes/chunk-000/file-000.parquet")
    assert episodes["dataset_from_index"].tolist() == [0, STEPS, 2 * STEPS]
    assert episodes["dataset_to_index"].tolist() == [STEPS, 2 * STEPS, 3 * STEPS]
    assert episodes["length"].tolist() == [STEPS] * 3
    assert [list(tasks) for tasks in episodes["tasks"]] == [["rope push"]] * 3
    tasks = pandas.read_parquet(root / "meta/tasks.parquet")
    assert (tasks.index.tolist(), tasks["task_index"].tolist()) == (["rope push"], [0])


def test_statistics_are_those_of_the_steps(root: Path, rows: Any, paths: list[Path]) -> None:
    stats = told(root, "stats.json")
    state = rows.select_columns(["observation.state"]).with_format("numpy")["observation.state"][:]
    assert np.allclose(stats["observation.state"]["mean"], state.mean(0), atol=1e-6)
    assert np.allclose(stats["observation.state"]["std"], state.std(0), atol=1e-6)
    assert np.allclose(stats["observation.state"]["q90"], np.quantile(state, 0.9, axis=0), atol=1e-6)
    assert stats["observation.state"]["count"] == [3 * STEPS]
    image = np.asarray(PIL.Image.open(io.BytesIO(next(iter(read_pictures(paths[0]))).jpeg))) / 255
    assert np.shape(stats[IMAGES[0]]["mean"]) == (3, 1, 1)
    assert np.allclose(np.ravel(stats[IMAGES[0]]["mean"]), image.mean((0, 1)), atol=0.01)
    depths = np.stack([np.asarray(row[DEPTHS[0]]) for row in rows.select_columns([DEPTHS[0]])])
    assert np.shape(stats[DEPTHS[0]]["mean"]) == (1, 1, 1)
    assert stats[DEPTHS[0]]["max"][0][0][0] <= depths.max()
    assert stats[DEPTHS[0]]["mean"][0][0][0] == pytest.approx(depths.mean(), rel=0.05)


def test_recordings_that_are_unlike_each_other_are_refused_by_name(paths: list[Path], tmp_path: Path) -> None:
    other = demonstration(tmp_path, particles=PARTICLES + 1)
    with pytest.raises(RecordingError, match=rf"{other.name} is unlike .*{paths[0].name}.*export them apart"):
        export([paths[0], other], tmp_path / "new", fps=FPS)


def test_a_recording_without_a_goal_or_an_action_is_refused_by_name(tmp_path: Path) -> None:
    from app.core.messages import Episode
    from tests.recording.samples import Maker, record

    path = record(tmp_path, Maker(seed=0)(Episode), [])
    with pytest.raises(RecordingError, match=rf"{path.name} holds no goal, object or action"):
        sample(path, FPS)


def test_a_folder_that_holds_something_is_left_alone(paths: list[Path], tmp_path: Path) -> None:
    (tmp_path / "mine.txt").touch()
    with pytest.raises(UsageError, match="is not empty"):
        export(paths, tmp_path, fps=FPS)


def test_without_its_packages_the_error_names_the_extra(
    paths: list[Path], tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    import sys

    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(PreflightError, match=r"pip install 'dipac\[lerobot\]'"):
        export(paths, tmp_path / "new", fps=FPS)
