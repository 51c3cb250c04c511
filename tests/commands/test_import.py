"""Importing measured data: a recording holds it as it was measured, or nothing is written and the error says why."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app.__main__ import main
from app.commands.import_ import import_
from app.core.errors import DipacError, RecordingError, UsageError
from app.core.geometry.table_place import TablePlace
from app.core.task_name import TaskName
from app.discovery.checks.limits import limits_of
from app.jobs.discovery_subject import subject_of
from app.recording.exchange.npz_import import read_plain
from app.recording.read.reader import read_transitions
from app.services.study import read_study
from app.tasks import load
from tests.cells.test_cell_file import GOOD, written
from tests.plain_data import EPISODES, OPTIONAL, POINTS, PUSHES, plain_arrays, saved

Arrays = dict[str, Any]


def imported(folder: Path, arrays: Arrays) -> Path:
    path = folder / "measured.mcap"
    import_(saved(folder, arrays), output=path)
    return path


@pytest.mark.parametrize("without", [(), *((kind,) for kind in (*OPTIONAL, "during")), (*OPTIONAL, "during")])
def test_what_was_imported_is_read_back_as_it_was(without: tuple[str, ...], tmp_path: Path) -> None:
    arrays = plain_arrays(without=without)
    study = read_study([imported(tmp_path, arrays)])
    assert [push.episode for push in study.pushes] == [n for n in range(EPISODES) for _ in range(PUSHES)]
    clouds = np.split(arrays["cloud_points"], arrays["cloud_offsets"][1:-1])
    views = [view for push in study.pushes for view in (push.before, *push.during, push.after)]
    assert [view.time_s for view in views] == arrays["cloud_time"].tolist()
    assert all(np.array_equal(view.points, cloud) for view, cloud in zip(views, clouds, strict=True))
    for push in study.pushes:
        own = (arrays["command_time"] >= push.before.time_s) & (arrays["command_time"] <= push.after.time_s)
        times, poses = arrays["command_time"][own], arrays["command_pose"][own]
        assert push.command.at(times) == pytest.approx(poses[:, :3], abs=1e-12)
        assert len(push.during) == ("during" not in without)
        assert (push.measured is None) == ("state" in without)
        if push.measured is not None:
            own = (arrays["state_time"] >= push.before.time_s) & (arrays["state_time"] <= push.after.time_s)
            assert push.measured.at(arrays["state_time"][own]) == pytest.approx(
                arrays["state_pose"][own, :3], abs=1e-12
            )
        assert all((view.finger is None) == ("tool" in without) for view in push.during)
    if "tool" not in without and "during" not in without:
        fingers = [view.finger for view in views if view.finger is not None]
        assert np.array_equal(np.concatenate(fingers), arrays["tool_points"])
    if "table" in without:
        assert not study.tables
    else:
        assert np.array_equal(np.concatenate([study.tables[n] for n in range(EPISODES)]), arrays["table_points"])


@pytest.mark.parametrize("points", [80, 1000])
def test_clouds_of_any_size_become_as_many_particles_as_the_task_has(points: int, tmp_path: Path) -> None:
    study = read_study([imported(tmp_path, plain_arrays(points=points))])
    for push in study.pushes:
        assert push.before.points.shape == push.after.points.shape == (POINTS, 3)


def test_what_was_measured_in_the_frame_of_the_base_is_recorded_in_that_of_the_table(tmp_path: Path) -> None:
    table = TablePlace(place_m=(0.1, -0.2, -0.15), turn_deg=30.0)
    place = "place_m = [0.1, -0.2, -0.15]\nturn_deg = 30.0"
    cell = written(tmp_path, GOOD.replace("place_m = [0.0, 0.0, 0.0]\nturn_deg = 0.0", place))
    here = plain_arrays()
    turn = Rotation.from_euler("z", 30.0, degrees=True)
    there = dict(here)
    for name in ("cloud_points", "tool_points", "table_points"):
        there[name] = (turn.apply(here[name]) + table.place_m).astype(np.float32)
    for name in ("command_pose", "state_pose"):
        quaternions = (turn * Rotation.from_quat(here[name][:, 3:], scalar_first=True)).as_quat(scalar_first=True)
        there[name] = np.concatenate([turn.apply(here[name][:, :3]) + table.place_m, quaternions], axis=1)
    own, moved = tmp_path / "own.mcap", tmp_path / "moved.mcap"
    import_(saved(tmp_path, here), output=own)
    import_(saved(tmp_path, there), output=moved, cell=cell)
    for one, other in zip(read_transitions(own), read_transitions(moved), strict=True):
        np.testing.assert_allclose(other.before, one.before, atol=1e-6)
        np.testing.assert_allclose(other.after, one.after, atol=1e-6)
        np.testing.assert_allclose(other.executed.made[:, :3], one.executed.made[:, :3], atol=1e-9)


def test_a_flat_finger_that_is_turned_in_the_frame_of_the_base_is_turned_in_that_of_the_table(tmp_path: Path) -> None:
    arrays = plain_arrays()
    about(tool={"half_width_m": 0.02, "yaw_rad": -3.0})(arrays)
    told = read_plain(saved(tmp_path, arrays)).in_table(TablePlace(turn_deg=30.0)).about["tool"]
    assert told["yaw_rad"] == pytest.approx(2 * np.pi - 3.0 - np.radians(30.0))
    assert told["half_width_m"] == 0.02


def test_a_motion_that_nobody_measured_counts_as_it_was_commanded(tmp_path: Path) -> None:
    path = imported(tmp_path, plain_arrays(without=("state",)))
    for transition in read_transitions(path):
        assert len(transition.executed.measured) == 0
        assert np.array_equal(transition.executed.made, transition.executed.commanded)


def test_a_task_that_the_file_does_not_name_is_given(tmp_path: Path) -> None:
    arrays = plain_arrays() | {"about": np.array("{}")}
    with pytest.raises(UsageError, match="--task"):
        imported(tmp_path, arrays)
    output = tmp_path / "named.mcap"
    import_(saved(tmp_path, arrays), output=output, task="rope_push")
    assert TaskName.parse(read_study([output]).task).problem == "rope_push"


def test_a_flat_finger_of_the_file_is_that_of_the_recordings_task(tmp_path: Path) -> None:
    tool = {"radius_m": 0.006, "half_width_m": 0.0125, "yaw_rad": -0.5}
    arrays = plain_arrays() | {"about": np.array(json.dumps({"task": "rope_push", "tool": tool}))}
    finger = load(read_study([imported(tmp_path, arrays)]).task).finger
    assert (finger.radius_m, finger.half_width_m, finger.yaw_rad) == (0.006, 0.0125, -0.5)


def test_a_recording_that_is_there_is_never_overwritten(tmp_path: Path) -> None:
    path = imported(tmp_path, plain_arrays())
    before = path.read_bytes()
    with pytest.raises(UsageError, match="exists"):
        imported(tmp_path, plain_arrays(seed=1))
    assert path.read_bytes() == before


def cut(name: str, length: int) -> Callable[[Arrays], None]:
    def change(arrays: Arrays) -> None:
        arrays[name] = arrays[name][:length]

    return change


def put(name: str, index: Any, value: Any) -> Callable[[Arrays], None]:
    def change(arrays: Arrays) -> None:
        arrays[name] = arrays[name].copy()
        arrays[name][index] = value

    return change


def scaled(name: str, by: float) -> Callable[[Arrays], None]:
    def change(arrays: Arrays) -> None:
        arrays[name] = (arrays[name] * by).astype(arrays[name].dtype)

    return change


def about(**values: Any) -> Callable[[Arrays], None]:
    def change(arrays: Arrays) -> None:
        arrays["about"] = np.array(json.dumps({"task": "rope_push"} | values))

    return change


def replaced(**values: Any) -> Callable[[Arrays], None]:
    return lambda arrays: arrays.update(values)


def gone(name: str) -> Callable[[Arrays], None]:
    def change(arrays: Arrays) -> None:
        del arrays[name]

    return change


def commands_of_one_push_missing(arrays: Arrays) -> None:
    """Drop the commands of the second push of the first episode."""
    first, last = arrays["cloud_time"][3], arrays["cloud_time"][5]
    kept = (arrays["command_time"] < first) | (arrays["command_time"] > last)
    for name in ("command_time", "command_pose", "command_episode"):
        arrays[name] = arrays[name][kept]


def in_milliseconds(arrays: Arrays) -> None:
    for name in ("cloud_time", "command_time", "state_time"):
        arrays[name] = 1e3 * arrays[name]


BAD: dict[str, tuple[Callable[[Arrays], None], str]] = {
    "points in the plane": (lambda a: a.update(cloud_points=a["cloud_points"][:, :2]), "cloud_points must have"),
    "a pose without a turn": (lambda a: a.update(command_pose=a["command_pose"][:, :3]), "command_pose must have"),
    "too few times": (cut("cloud_time", 5), r"cloud_time must have the shape \(18\)"),
    "words for numbers": (replaced(cloud_push=np.array(["a"] * 18)), "cloud_push must hold whole numbers"),
    "no point": (put("cloud_points", (417, 1), np.nan), r"cloud_points\[417\] is not finite"),
    "no pose": (put("command_pose", (5, 0), np.inf), r"command_pose\[5\] is not finite"),
    "no time": (put("state_time", 7, np.nan), r"state_time\[7\] is not finite"),
    "clouds out of order": (put("cloud_time", 2, 0.1), r"cloud_time\[2\] = 0.1 s is not after"),
    "a clock that runs back": (put("command_time", 9, 0.0), r"command_time\[9\] = 0 s is not after"),
    "an episode out of order": (put("cloud_episode", 8, 3), r"cloud_episode\[9\] goes back"),
    "an unknown phase": (put("cloud_phase", 4, "amid"), r"cloud_phase\[4\] is 'amid'; known are before, during, after"),
    "a push without an end": (put("cloud_phase", 5, "during"), r"cloud_phase\[5\] must be 'after'"),
    "a push without a start": (put("cloud_phase", 3, "during"), r"cloud_phase\[3\] must be 'before'"),
    "offsets that do not begin": (put("cloud_offsets", 0, 1), r"cloud_offsets\[0\] must be 0"),
    "offsets that go back": (put("cloud_offsets", 3, 100), r"cloud_offsets\[3\] is less"),
    "offsets that leave points over": (put("cloud_offsets", -1, 5399), r"cloud_offsets\[18\] must be 5400"),
    "offsets of other clouds": (cut("tool_offsets", 10), "tool_offsets must have"),
    "almost no points": (put("cloud_offsets", 1, 5), r"cloud_offsets\[1\] gives cloud 0 5 points"),
    "clouds in millimetres": (scaled("cloud_points", 1000.0), r"cloud_points\[0\] lies .* give metres"),
    "poses in millimetres": (scaled("state_pose", 1000.0), r"state_pose\[0\] lies .* give metres"),
    "a leap of the arm": (put("command_pose", (30, 0), 3.0), r"command_pose\[30\] lies .* no arm is as fast"),
    "no quaternion": (put("command_pose", (4, slice(3, 7)), 0.0), r"command_pose\[4\] has a quaternion"),
    "nanoseconds": (scaled("cloud_time", 1e9), r"cloud_time\[\d+\] = .* seconds"),
    "milliseconds": (in_milliseconds, "cloud_time.*seconds"),
    "a rope 400 m long": (about(object={"length_m": 400}), "object.length_m is 400"),
    "a rope shorter than its cloud": (about(object={"length_m": 0.1}), "cloud 0, are .* across"),
    "a finger as wide as a table": (about(tool={"half_width_m": 400}), "tool.half_width_m is 400"),
    "a yaw in degrees": (about(tool={"half_width_m": 0.01, "yaw_rad": 45}), "tool.yaw_rad is 45; give radians"),
    "a size in words": (about(object={"length_m": "long"}), "object.length_m is 'long'"),
    "an object in words": (about(object="rope"), "about.object must be a JSON object"),
    "an unknown task": (about(task="rope_pusch"), "Unknown task 'rope_pusch'. Did you mean 'rope_push'"),
    "no JSON": (replaced(about=np.array("{")), "about is no JSON"),
    "no string": (replaced(about=np.array(3)), "about must be one string"),
    "commands missing": (commands_of_one_push_missing, r"command_time has not two values from cloud_time\[3\]"),
    "a table of no episode": (put("table_episode", 1, 7), "table_episode has episode 7"),
    "a table twice": (put("table_episode", 1, 0), r"table_episode\[1\] names episode 0 again"),
    "no clouds": (gone("cloud_points"), "the array cloud_points is missing"),
    "half of the arm's log": (gone("state_pose"), "the array state_pose is missing"),
    "an unknown array": (replaced(state_pos=np.zeros(3)), "Unknown array 'state_pos'. Did you mean 'state_pose'"),
}


@pytest.mark.parametrize("name", BAD)
def test_bad_data_are_refused_by_name_and_nothing_is_written(name: str, tmp_path: Path) -> None:
    change, said = BAD[name]
    arrays = plain_arrays()
    change(arrays)
    with pytest.raises(DipacError, match=said):
        imported(tmp_path, arrays)
    assert [path.name for path in tmp_path.iterdir()] == ["measured.npz"]


def test_what_is_no_archive_of_arrays_is_refused(tmp_path: Path) -> None:
    path = tmp_path / "measured.npz"
    for content in (b"", b"no archive", saved(tmp_path, plain_arrays()).read_bytes()[:-300]):
        path.write_bytes(content)
        with pytest.raises(RecordingError, match=r"no \.npz file"):
            import_(path, output=tmp_path / "out.mcap")
    with pytest.raises(UsageError, match="Unknown file"):
        import_(tmp_path / "other.npz", output=tmp_path / "out.mcap")


@pytest.mark.parametrize(
    ("begin", "kind"),
    [
        (b"\x93NUMPY\x01\x00", "one array without a name"),
        (b"PAR1", "Parquet"),
        (b"\x89HDF\r\n\x1a\n", "HDF5"),
        (b"\x89MCAP0\r\n", "MCAP"),
        (b"SQLite format 3\0", "ROS 2 bag"),
        (b"\x80\x04\x95", "pickle"),
    ],
)
def test_files_of_other_kinds_are_called_what_they_are(begin: bytes, kind: str, tmp_path: Path) -> None:
    path = tmp_path / "measured.npz"
    path.write_bytes(begin + bytes(40))
    with pytest.raises(RecordingError, match=kind) as refused:
        import_(path, output=tmp_path / "a.mcap")
    assert "numpy.savez" in str(refused.value)
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.serial
def test_the_script_in_the_documentation_makes_such_a_file(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    page = (Path(__file__).parents[2] / "docs" / "recording-format.md").read_text(encoding="utf-8")
    script = page.split("```python\n")[1].split("```")[0]
    monkeypatch.chdir(tmp_path)
    subprocess.run([sys.executable, "-c", script], check=True)
    import_(Path("measured.npz"), output=Path("measured.mcap"))
    study = read_study([Path("measured.mcap")])
    assert len(study.pushes) == 24
    assert all(push.during and push.measured is None for push in study.pushes)
    said = {limit.text for limit in limits_of(study, subject_of(load("rope_push")))}
    assert said == {
        "The pushes go in 1 direction; 4 are asked for.",
        "Where the tool really went was measured in 0 of 24 pushes.",
        "The tool was not seen during any push.",
        "The bare table was not seen.",
    }


def spoilt(folder: Path, kind: str) -> Path:
    """A file of the right name that is no archive of plain arrays."""
    file = saved(folder, plain_arrays())
    data = bytearray(file.read_bytes())
    match kind:
        case "npy":
            np.save(file.with_suffix(".npy"), np.zeros((40, 3)))
            file = file.with_suffix(".npy")
        case "encrypted" | "method":
            for mark, offset in ((b"PK\x03\x04", 6), (b"PK\x01\x02", 8)):
                at = -1
                while (at := data.find(mark, at + 1)) >= 0:
                    if kind == "encrypted":
                        data[at + offset] |= 1
                    else:
                        data[at + offset + 2] = 97
            file.write_bytes(data)
        case "objects":
            np.savez(file, **plain_arrays() | {"cloud_time": np.array([1, None], object)})
        case "parquet":
            file.write_bytes(b"PAR1" + bytes(100))
        case _:
            file.write_bytes(b"")
    return file


@pytest.mark.parametrize(
    ("kind", "words"),
    [
        ("npy", "numpy.savez"),
        ("encrypted", "encrypted"),
        ("method", "compression"),
        ("objects", "Python objects"),
        ("parquet", "no .npz archive"),
        ("empty", "no .npz archive"),
    ],
)
@pytest.mark.parametrize("command", ["import", "replay"])
def test_what_is_no_archive_is_said_in_one_line(kind: str, words: str, command: str, tmp_path: Path, capsys) -> None:
    file = spoilt(tmp_path, kind)
    more = ["-o", str(tmp_path / "a.mcap")] if command == "import" else []
    assert main([command, str(file), *more]) == RecordingError.exit_code
    said = capsys.readouterr().err
    assert words in said
    assert said.count("\n") == 1
    assert "If you trust" not in said
    assert not (tmp_path / "a.mcap").exists()


@pytest.mark.parametrize("length", ["[" * 100_000 + "]" * 100_000, "1" + "0" * 400, "1" + "0" * 5000, "-1" + "0" * 400])
def test_absurd_numbers_and_nests_in_about_are_said_in_one_line(length: str, tmp_path: Path, capsys) -> None:
    about = '{"task": "rope_push", "object": {"length_m": ' + length + "}}"
    file = saved(tmp_path, plain_arrays() | {"about": np.array(about)})
    assert main(["import", str(file), "-o", str(tmp_path / "a.mcap")]) == RecordingError.exit_code
    said = capsys.readouterr().err
    assert "about" in said
    assert said.count("\n") == 1
