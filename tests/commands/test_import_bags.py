"""Importing bags of ROS 2: what is in them is shown, mapped and written as a recording, or nothing is left behind."""

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from app.__main__ import main
from app.commands.import_ import import_
from app.core.errors import DipacError, RecordingError, UsageError
from app.core.messages import Frame, Particles
from app.recording.exchange.streams.stream_map import read_stream_map
from app.recording.library.checks import check
from app.recording.library.recording_index import shelf
from app.recording.read.clouds import write_npz
from app.recording.read.film import read_film
from app.recording.read.reader import read_episode, read_messages, read_transitions
from app.services.study import read_study
from tests.cells.test_cell_file import GOOD, written
from tests.recording import bags
from tests.recording.bags import BagWriter, Event
from tests.recording.rope_scene import LENGTH_M, RADIUS_M, ROPE_RGB, TABLE_RGB, RopeScene

pytest.importorskip("rosbags", reason="The package `rosbags` is missing; install dipac[ros2].")
SCENE = RopeScene(pushes=2, step_s=0.05, image_s=0.5)


def with_depth() -> list[Event]:
    return [bags.static_camera(), *bags.tool_transforms(SCENE), *bags.images(SCENE)]


def with_clouds() -> list[Event]:
    return [*bags.tool_poses(SCENE), *bags.tool_poses(SCENE, bags.TARGET), *bags.clouds(SCENE)]


@pytest.fixture(scope="module")
def bag(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return BagWriter().write(tmp_path_factory.mktemp("bags") / "depth", with_depth())


@pytest.fixture(scope="module")
def recording(bag: Path) -> Path:
    path = bag.parent / "depth.mcap"
    import_(bag, output=path, task="rope_push")
    return path


def test_pushes_are_found_between_the_tools_rests(recording: Path) -> None:
    transitions = list(read_transitions(recording))
    assert len(transitions) == SCENE.pushes
    for transition in transitions:
        gone = transition.after.mean(axis=0) - transition.before.mean(axis=0)
        moved = SCENE.rope_at(transition.executed.times_s[-1]) - SCENE.rope_at(transition.executed.times_s[0])
        assert gone[0] == pytest.approx(moved, abs=2e-3)
        assert np.abs(gone[1:]).max() < 1e-3
        # What nobody measured is as commanded, and not measured.
        assert len(transition.executed.measured) == 0


def test_the_rope_of_the_images_is_that_of_the_recording(recording: Path) -> None:
    study = read_study([recording])
    assert study.setup is not None
    sizes = {size.name: size.value for size in study.setup.sizes}
    assert sizes["length_m"] == pytest.approx(LENGTH_M, abs=0.012)
    assert sizes["radius_m"] == pytest.approx(RADIUS_M, abs=1.5e-3)
    assert len(study.tables[0]) > 100
    assert np.abs(study.tables[0][:, 2]).max() < 2e-3


def test_the_images_are_in_the_recording_with_what_they_show(recording: Path) -> None:
    frames = {it.id: it for it in read_messages(recording, [Frame]) if isinstance(it, Frame)}
    seen = [it for it in read_messages(recording, [Particles]) if isinstance(it, Particles)]
    assert seen
    for particles in seen:
        assert [frames[cause].time_s for cause in particles.cause] == pytest.approx([particles.time_s], abs=1e-6)
    assert list(read_film(recording).cameras) == ["front"]


def test_the_recording_is_whole_and_began_when_the_bag_did(recording: Path) -> None:
    assert not check(recording)
    assert read_episode(recording).rig == "imported"
    (entry,) = shelf([recording])
    assert entry.began is not None
    assert entry.began.timestamp() == pytest.approx(bags.START_NS / bags.NS, abs=1.0)


def test_clouds_and_commands_are_imported_as_measured(tmp_path: Path) -> None:
    path = tmp_path / "clouds.mcap"
    import_(BagWriter(storage="sqlite3").write(tmp_path / "bag", with_clouds()), output=path, task="rope_push")
    transitions = list(read_transitions(path))
    assert len(transitions) == SCENE.pushes
    assert all(len(it.executed.measured) for it in transitions)
    assert write_npz(path, tmp_path / "again.npz") == SCENE.pushes
    import_(tmp_path / "again.npz", output=tmp_path / "again.mcap")
    for one, other in zip(transitions, read_transitions(tmp_path / "again.mcap"), strict=True):
        np.testing.assert_allclose(other.before, one.before, atol=1e-6)


def test_the_object_is_told_by_its_colour_in_clouds_of_everything(tmp_path: Path) -> None:
    rng, events = np.random.default_rng(0), list(bags.tool_poses(SCENE))
    for time_s in SCENE.image_times().tolist():
        rope, rest = SCENE.surface(time_s), rng.uniform([0.3, -0.3, -0.001], [0.8, 0.3, 0.03], (2000, 3))
        colours = np.concatenate([np.tile(ROPE_RGB, (len(rope), 1)), np.tile(TABLE_RGB, (len(rest), 1))])
        cloud = bags.point_cloud(time_s, "base_link", np.concatenate([rope, rest]), colours)
        events.append((time_s, "/camera/points", "sensor_msgs/msg/PointCloud2", cloud))
    path = tmp_path / "told.mcap"
    import_(BagWriter().write(tmp_path / "bag", events), output=path, task="rope_push")
    seen = [it.surface for it in read_messages(path, [Particles]) if isinstance(it, Particles)]
    for surface in seen:
        assert np.ptp(surface[:, 0]) < 2.5 * RADIUS_M


def test_what_is_shown_is_a_file_that_maps_the_same(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    import_(bag, show=True)
    text = capsys.readouterr().out
    assert "sensor_msgs/msg/Image" in text
    assert "320x240 16UC1, frame front_color_optical_frame" in text
    file = tmp_path / "topics.toml"
    file.write_text(text)
    assert read_stream_map(file).tool.frame == "tool0"
    import_(bag, show=True, topics=file)
    assert capsys.readouterr().out == text
    assert not list(tmp_path.glob("*.mcap"))


def test_the_mapping_is_shown_before_anything_is_written(
    bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    with pytest.raises(UsageError, match="names no task"):
        import_(bag, output=tmp_path / "new.mcap")
    assert 'frame = "tool0"' in capsys.readouterr().out
    assert not list(tmp_path.iterdir())


def edited(bag: Path, folder: Path, edit: Callable[[str], str]) -> Path:
    """A file for --topics: what --show prints, edited."""
    import contextlib
    import io

    with contextlib.redirect_stdout(io.StringIO()) as shown:
        import_(bag, show=True)
    file = folder / "topics.toml"
    file.write_text(edit(shown.getvalue()))
    return file


def test_an_edited_mapping_says_task_tool_and_pushes(bag: Path, tmp_path: Path) -> None:
    def edit(text: str) -> str:
        about = '[about]\ntask = "rope_push"\n[about.object]\nlength_m = 0.36\n[about.tool]\nradius_m = 0.008\n'
        return text.replace("[tool]", f"pushes = [[0.9, 3.2]]\n{about}[tool]")

    path = tmp_path / "edited.mcap"
    import_(bag, output=path, topics=edited(bag, tmp_path, edit))
    (transition,) = read_transitions(path)
    assert transition.executed.times_s[0] >= 0.5
    assert "length_m=0.36" in read_episode(path).task
    assert json.loads(read_episode(path).config)["tool"] == {"radius_m": 0.008}


@pytest.mark.parametrize(
    ("edit", "said"),
    [
        (lambda text: text.replace("[tool]", "[tools]"), "'tools' is not known. Did you mean 'tool'"),
        (lambda text: text.replace('clock = "header"', 'clock = "sundial"'), "known are header, receive"),
        (lambda text: text.replace('"tool0"', '"tool9"'), "'base_link' and 'tool9' are not connected"),
        (lambda text: text.replace('"tool0"', f'"{bags.OPTICAL}"'), "never moves against"),
        (lambda text: text.replace("[tool]", "pushes = [[4.0, 2.0]]\n[tool]"), "ends at 2 s before it begins at 4 s"),
        (lambda text: text.replace("[tool]", "[object]\nhue_deg = [200.0, 220.0]\n[tool]"), "No view shows the object"),
        (lambda text: text.replace("[tool]", "[object]\nlow_m = [1.0, 1.0, 0.0]\n[tool]"), "must be below|No view"),
        (lambda text: text.replace("[tool]", "[about.tool]\nradius_m = 9.0\n[tool]"), "tool.radius_m is 9"),
        (lambda text: text.replace("[tool]", "pushes = [[90.0, 95.0]]\n[tool]"), "view of the object before and one"),
    ],
)
def test_a_wrong_mapping_is_refused_and_leaves_nothing(
    bag: Path, edit: Callable[[str], str], said: str, tmp_path: Path
) -> None:
    topics = edited(bag, tmp_path, edit)
    with pytest.raises(DipacError, match=said):
        import_(bag, output=tmp_path / "new.mcap", task="rope_push", topics=topics)
    assert list(tmp_path.iterdir()) == [topics]


def test_a_bag_that_is_damaged_amid_its_images_leaves_nothing(tmp_path: Path) -> None:
    folder = BagWriter().write(tmp_path / "bag", with_depth())
    file = folder / "bag.mcap"
    data = bytearray(file.read_bytes())
    data[len(data) // 5 : -len(data) // 5] = bytes(len(data[len(data) // 5 : -len(data) // 5]))
    file.write_bytes(bytes(data))
    with pytest.raises(RecordingError, match=r"damaged|cannot be read") as told:
        import_(folder, output=tmp_path / "new.mcap", task="rope_push")
    assert "\n" not in str(told.value)
    assert list(tmp_path.iterdir()) == [folder]


def test_a_tool_far_from_the_object_is_said(tmp_path: Path) -> None:
    times, places = SCENE.tool()
    far = [
        (time_s, bags.POSE, "geometry_msgs/msg/PoseStamped", bags.pose_stamped(time_s, "base_link", pose))
        for time_s, pose in zip(times.tolist(), bags.poses(places + np.array([0.0, 1.0, 0.0])), strict=True)
    ]
    path = BagWriter().write(tmp_path / "bag", [*far, *bags.clouds(SCENE)])
    with pytest.raises(RecordingError, match="tool and object are not in one frame"):
        import_(path, output=tmp_path / "new.mcap", task="rope_push")


def test_one_camera_without_depth_is_refused(tmp_path: Path) -> None:
    events = [bags.static_camera(), *bags.tool_transforms(SCENE), *bags.images(SCENE, depth=False)]
    with pytest.raises(RecordingError, match="nothing says how far the object is"):
        import_(BagWriter().write(tmp_path / "bag", events), output=tmp_path / "new.mcap", task="rope_push")


def test_a_table_elsewhere_comes_from_the_cells_file(tmp_path: Path) -> None:
    scene = replace(SCENE, pushes=1)
    path = BagWriter().write(
        tmp_path / "bag", [bags.static_camera(), *bags.tool_transforms(scene), *bags.images(scene)]
    )
    place = "place_m = [0.0, 0.05, 0.0]\nturn_deg = 0.0"
    cell = written(tmp_path, GOOD.replace("place_m = [0.0, 0.0, 0.0]\nturn_deg = 0.0", place))
    here, there = tmp_path / "here.mcap", tmp_path / "there.mcap"
    import_(path, output=here, task="rope_push")
    import_(path, output=there, task="rope_push", cell=cell)
    (one,), (other,) = read_transitions(here), read_transitions(there)
    assert one.before.mean(axis=0) - other.before.mean(axis=0) == pytest.approx([0.0, 0.05, 0.0], abs=1e-3)
    cameras = [read_film(it).cameras["front"].T_world_camera[:3, 3] for it in (here, there)]
    assert cameras[0] - cameras[1] == pytest.approx([0.0, 0.05, 0.0], abs=1e-6)


def test_errors_are_one_line_on_the_command_line(bag: Path, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert main(["import", str(bag), "--task", "rope_push"]) == 2
    assert main(["import", str(bag), "-o", str(tmp_path / "x.mcap"), "--task", "rope_pull"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert "-o REC.mcap" in said[0]
    assert "rope_push" in said[1]
    assert len(said) == 2
