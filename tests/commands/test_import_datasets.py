"""Importing LeRobot datasets: depth and poses become pushes; what cannot be simulated is said with what is needed."""

import json
import subprocess
import sys
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from app.commands.import_ import import_
from app.core.errors import DipacError, RecordingError
from app.core.messages import Episode, Executed, Frame, Goal, Particles, Transition, fresh_id
from app.recording.exchange.foreign_file import open_foreign
from app.recording.exchange.lerobot.dataset import export
from app.recording.exchange.lerobot.videos import metres_of
from app.recording.exchange.streams.measured_episode import MeasuredEpisode
from app.recording.read.reader import read_messages, read_transitions
from tests.recording.datasets import COLOR, DEPTH, QUANTISED, quantised, video_path, write_dataset
from tests.recording.demonstrations import demonstration
from tests.recording.rope_scene import RADIUS_M, RopeScene, camera_pose
from tests.recording.samples import record

pytest.importorskip("pyarrow", reason="The package `pyarrow` is missing; install dipac[lerobot].")
SCENE = RopeScene(pushes=1)
PLACED = (
    'name = "front"\nintrinsics = [260.0, 260.0, 159.5, 119.5]\npose = [0.5, 0.0, 0.7, 0.0, 1.0, 0.0, 0.0]\n'
    "distortion = [0.0, 0.0, 0.0, 0.0, 0.0]"
)


def topics(root: Path, capsys: pytest.CaptureFixture[str], edit: Callable[[str], str] = lambda text: text) -> Path:
    """A mapping with the camera's place, as --show prints it but for that."""
    capsys.readouterr()
    import_(root, show=True)
    file = root.parent / "topics.toml"
    file.write_text(edit(capsys.readouterr().out.replace('name = "front"', PLACED)))
    return file


def episode_of(root: Path) -> MeasuredEpisode:
    with open_foreign(root) as source:
        return source.episodes(source.guess())[0]


@pytest.mark.parametrize("video", [False, True], ids=["images", "videos"])
def test_an_episode_is_a_push_with_depth_command_and_measured_poses(
    video: bool, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    if video:
        pytest.importorskip("av", reason="The package `av` is missing; install dipac[lerobot].")
    root = write_dataset(tmp_path / "set", SCENE, video=video)
    path = tmp_path / "set.mcap"
    import_(root, output=path, task="rope_push", topics=topics(root, capsys))
    transitions = list(read_transitions(path))
    assert len(transitions) == 2
    for transition in transitions:
        assert len(transition.executed.measured)
        gone = transition.after.mean(axis=0) - transition.before.mean(axis=0)
        assert gone[0] == pytest.approx(SCENE.rope_at(1e9) - SCENE.rope_at(0.0), abs=3e-3)
        assert np.ptp(transition.before[:, 0]) == pytest.approx(2 * RADIUS_M, abs=4e-3)


def test_depth_is_unquantised_as_lerobot_quantises_it() -> None:
    away = np.linspace(0.11, 1.9, 200).reshape(10, 20)
    assert metres_of(quantised(away), QUANTISED) == pytest.approx(away, abs=2e-3)
    linear = {"video.depth_min": 0.0, "video.depth_max": 4.095, "video.use_log": False}
    assert metres_of(np.array([[0, 1, 4095]], np.uint16), linear).tolist() == [[0.0, 0.001, 4.095]]


def test_a_dataset_that_this_program_wrote_is_read_again(tmp_path: Path) -> None:
    root, path = tmp_path / "set", demonstration(tmp_path, seed=0)
    assert export([path], root, fps=10).is_placed
    episode = episode_of(root)
    assert episode.state is not None
    assert episode.command is not None
    assert episode.command.times_s[0] == pytest.approx(0.1)
    recorded = [message for message in read_messages(path, [Frame]) if isinstance(message, Frame)]
    for first, again in zip(recorded[:2], episode.look(0.0).frames, strict=True):
        assert again.camera.name == first.camera.name
        assert np.allclose(again.camera.K, first.camera.K)
        assert np.allclose(again.camera.T_world_camera, first.camera.T_world_camera)
        assert np.array_equal(again.depth, first.depth)
        assert again.camera.depth_unit_m == first.camera.depth_unit_m
        # Both went through the same JPEG.
        assert np.array_equal(again.color, first.color)


def test_depth_in_parts_of_a_millimetre_comes_in_to_a_tenth_of_one(tmp_path: Path) -> None:
    root, path = tmp_path / "set", demonstration(tmp_path, seed=0, depth_unit_m=0.00005)
    export([path], root, fps=10)
    first = next(message for message in read_messages(path, [Frame]) if isinstance(message, Frame))
    again = episode_of(root).look(0.0).frames[0]
    assert again.camera.depth_unit_m == 0.0001
    assert again.depth * 0.0001 == pytest.approx(first.depth * 0.00005, abs=0.5001e-4)


def test_pushes_that_go_out_as_a_dataset_come_in_again_as_they_were(tmp_path: Path, capsys) -> None:
    first, again, root = tmp_path / "first.mcap", tmp_path / "again.mcap", tmp_path / "out"
    source = write_dataset(tmp_path / "set", RopeScene(pushes=2), episodes=1)
    import_(source, output=first, task="rope_push", topics=topics(source, capsys))
    said = list(read_messages(first))
    episode = next(message for message in said if isinstance(message, Episode))
    seen = next(message for message in said if isinstance(message, Particles))
    goal = Goal(id=fresh_id("goal"), time_s=seen.time_s, positions=seen.positions)  # Measured pushes have none.
    kinds = Particles | Frame | Executed | Transition
    shown = record(tmp_path / "shown", episode, [goal, *(it for it in said if isinstance(it, kinds))])
    export([shown], root, fps=20, rest_s=0.5)
    import_(root, output=again)  # Task, tool and cameras stand in the dataset.
    before, after = read_transitions(first), read_transitions(again)
    assert len(before) == len(after) == 2
    for one, other in zip(before, after, strict=True):
        for cloud, same in ((one.before, other.before), (one.after, other.after)):
            assert place_and_size(cloud) == pytest.approx(place_and_size(same), abs=1e-3)
        assert np.ptp(other.executed.commanded, axis=0)[:3] == pytest.approx(
            np.ptp(one.executed.commanded, axis=0)[:3], abs=5e-3
        )


def place_and_size(cloud: np.ndarray) -> list[float]:
    """Middle and extent of a cloud [m]."""
    return [*cloud.mean(axis=0), *np.ptp(cloud, axis=0)]


def test_a_place_and_a_rotation_vector_are_a_pose(tmp_path: Path) -> None:
    root = write_dataset(tmp_path / "set", SCENE)
    info = json.loads((root / "meta" / "info.json").read_text())
    info["features"]["observation.state"]["names"] = {
        "motors": [f"ee.{name}" for name in ("x", "y", "z", "wx", "wy", "wz", "a", "b")]
    }
    (root / "meta" / "info.json").write_text(json.dumps(info))
    with open_foreign(root) as source:
        assert source.guess().tool.pose == "observation.state"


def test_joint_positions_in_degrees_place_the_tool_by_a_description(tmp_path: Path) -> None:
    root = write_dataset(tmp_path / "set", SCENE)
    (root / "arm.urdf").write_text(
        '<robot name="r"><link name="base"/><link name="tip"/><joint name="turn" type="revolute"><parent link="base"/>'
        '<child link="tip"/><axis xyz="0 0 1"/></joint></robot>'
    )
    info = json.loads((root / "meta" / "info.json").read_text())
    info["features"]["observation.state"]["names"] = ["turn.pos", *"abcdefg"]
    info["features"]["action"]["names"] = None
    (root / "meta" / "info.json").write_text(json.dumps(info))
    with open_foreign(root) as source:
        streams = source.guess()
        assert not streams.tool.pose
        with pytest.raises(RecordingError, match=r"nothing says where camera|nothing says where the tool was"):
            source.episodes(streams)


BAD: list[tuple[str, Callable[[Path], object], str]] = [
    ("older", lambda root: edit_info(root, codebase_version="v2.1"), "v3 is read.*convert_dataset_v21_to_v30"),
    ("no info", lambda root: (root / "meta/info.json").write_text("{"), "download the dataset again"),
    ("no steps", lambda root: edit_info(root, fps=0), "no number of steps a second"),
    ("no data", lambda root: (root / "data/chunk-000/file-000.parquet").write_bytes(b"PAR1"), "no parquet file"),
    ("no episodes", lambda root: (root / "meta/episodes/chunk-000/file-000.parquet").unlink(), "holds no parquet file"),
    ("no video", lambda root: video_path(root, COLOR).unlink(), "is not there; download the dataset with its videos"),
    ("cut video", lambda root: video_path(root, DEPTH).write_bytes(b"\0" * 100), "cannot be decoded"),
]


def edit_info(root: Path, **fields: object) -> None:
    file = root / "meta" / "info.json"
    file.write_text(json.dumps({**json.loads(file.read_text()), **fields}))


@pytest.mark.parametrize(("damage", "said"), [it[1:] for it in BAD], ids=[it[0] for it in BAD])
def test_a_damaged_dataset_says_what_is_wrong_and_leaves_nothing(
    damage: Callable[[Path], object], said: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    pytest.importorskip("av", reason="The package `av` is missing; install dipac[lerobot].")
    root = write_dataset(tmp_path / "set", SCENE, episodes=1, video=True)
    file = topics(root, capsys)
    damage(root)
    with pytest.raises(DipacError, match=said) as told:
        import_(root, output=tmp_path / "new.mcap", task="rope_push", topics=file)
    assert "\n" not in str(told.value)
    assert not list(tmp_path.glob("*.mcap*"))


def test_what_cannot_be_simulated_is_said_with_what_is_needed(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    root, path = write_dataset(tmp_path / "set", SCENE, episodes=1, depth=False), tmp_path / "new.mcap"
    with pytest.raises(RecordingError, match=r"nothing says where camera 'front' is and how it sees; give intrinsics"):
        import_(root, output=path, task="rope_push")
    with pytest.raises(RecordingError, match="has no depth, so nothing says how far the object is"):
        import_(root, output=path, task="rope_push", topics=topics(root, capsys))
    bare = topics(root, capsys, lambda text: text[: text.index("[[camera]]")])
    with pytest.raises(RecordingError, match="no image of the object and no points of it; needed are depth"):
        import_(root, output=path, task="rope_push", topics=bare)
    assert not path.exists()


@pytest.mark.serial
@pytest.mark.parametrize(("missing", "extra"), [("rosbags", "ros2"), ("pyarrow", "lerobot")])
def test_a_missing_package_is_named_with_what_installs_it(missing: str, extra: str, tmp_path: Path) -> None:
    if missing == "rosbags":
        (tmp_path / "file.mcap").write_bytes(b"")
    else:
        (tmp_path / "meta").mkdir()
        (tmp_path / "meta" / "info.json").write_text('{"codebase_version": "v3.0", "features": {}, "fps": 10}')
    path = tmp_path / "file.mcap" if missing == "rosbags" else tmp_path
    code = f"import sys; sys.modules[{missing!r}] = None; from app.__main__ import main; sys.exit(main())"
    run = subprocess.run(
        [sys.executable, "-c", code, "import", str(path), "--show"], capture_output=True, text=True, check=False
    )
    assert run.returncode == 3
    assert f"pip install 'dipac[{extra}]'" in run.stderr
    assert len(run.stderr.splitlines()) == 1


def test_the_camera_of_the_tests_is_where_the_mapping_says() -> None:
    assert camera_pose()[:3, 3].tolist() == [0.5, 0.0, 0.7]
