"""Importing folders of images, or of files of points, with the poses of the tool in a table."""

from collections.abc import Callable, Iterator
from pathlib import Path

import cv2
import numpy as np
import pytest
import trimesh

from app.commands.import_ import import_
from app.core.errors import DipacError
from app.core.messages import Frame
from app.recording.read.reader import read_messages, read_transitions
from tests.recording.rope_scene import RopeScene, poses

SCENE = RopeScene(pushes=1, step_s=0.1)
EVERY = 5
"""Poses from one with images to the next."""
HEAD = ["time", "x", "y", "z", "qw", "qx", "qy", "qz"]
TOPICS = """
[tool]
pose = "pose"
[[camera]]
name = "camera"
color = "image"
depth = "depth"
intrinsics = [260.0, 260.0, 159.5, 119.5]
pose = [0.5, 0.0, 0.7, 0.0, 1.0, 0.0, 0.0]
"""


def table(columns: list[str], files: Callable[[int, float], list[str]], join: str = ",") -> str:
    """The poses, and the files at every fifth of them."""

    def lines() -> Iterator[str]:
        yield join.join([*HEAD, *columns])
        times, places = SCENE.tool()
        for index, (time_s, pose) in enumerate(zip(times.tolist(), poses(places), strict=True)):
            named = files(index, time_s) if index % EVERY == 0 else [""] * len(columns)
            numbers = [f"{value:.6f}" for value in (time_s, *pose)]
            yield join.join([*(it.replace(".", ",") if join == ";" else it for it in numbers), *named])

    return "\n".join(lines()) + "\n"


def image_folder(folder: Path, *, join: str = ",", as_array: bool = False) -> Path:
    def files(index: int, time_s: float) -> list[str]:
        color, away = SCENE.images(time_s)
        cv2.imwrite(str(folder / f"{index}.png"), color[..., ::-1])
        if as_array:
            np.save(folder / f"{index}_depth.npy", away.astype(np.float32))
            return [f"{index}.png", f"{index}_depth.npy"]
        cv2.imwrite(str(folder / f"{index}_depth.png"), np.round(1000 * away).astype(np.uint16))
        return [f"{index}.png", f"{index}_depth.png"]

    folder.mkdir()
    (folder / "poses.csv").write_text(table(["image", "depth"], files, join), encoding="utf-8-sig")
    return folder


def cloud_folder(folder: Path, suffix: str) -> Path:
    def files(index: int, time_s: float) -> list[str]:
        points, path = SCENE.surface(time_s), folder / f"{index}.{suffix}"
        if suffix == "ply":
            trimesh.PointCloud(points).export(str(path))
        elif suffix == "npz":
            np.savez(path, points=points)
        else:
            np.save(path, points)
        return [path.name]

    folder.mkdir()
    (folder / "poses.csv").write_text(table(["points"], files))
    return folder


def require_push(path: Path, within_m: float) -> None:
    (transition,) = read_transitions(path)
    gone = transition.after.mean(axis=0) - transition.before.mean(axis=0)
    assert gone[0] == pytest.approx(SCENE.rope_at(1e9) - SCENE.rope_at(0.0), abs=within_m)
    assert len(transition.executed.measured) == 0


@pytest.mark.parametrize(("join", "as_array"), [(",", False), (";", False), ("\t", True)])
def test_images_with_depth_and_poses_are_a_push(join: str, as_array: bool, tmp_path: Path) -> None:
    folder = image_folder(tmp_path / "images", join=join, as_array=as_array)
    (tmp_path / "topics.toml").write_text(TOPICS)
    import_(folder, output=tmp_path / "new.mcap", task="rope_push", topics=tmp_path / "topics.toml")
    require_push(tmp_path / "new.mcap", 3e-3)


@pytest.mark.parametrize(("far_m", "unit_m"), [(0.0, 0.0001), (9.0, 0.001)])
def test_depth_of_which_some_images_are_whole_millimetres_comes_in_in_one_unit(
    far_m: float, unit_m: float, tmp_path: Path
) -> None:
    folder, truth = image_folder(tmp_path / "images", as_array=True), dict[float, np.ndarray]()
    for number, file in enumerate(sorted(folder.glob("*.npy"), key=lambda it: int(it.stem.partition("_")[0]))):
        away = np.load(file)
        if number % 2 == 0:
            away = np.round(away, 3)
        if number % 2 == 0 and far_m:
            away[0, 0] = far_m
        np.save(file, away)
        truth[SCENE.tool()[0][number * EVERY]] = away
    (tmp_path / "topics.toml").write_text(TOPICS)
    import_(folder, output=tmp_path / "new.mcap", task="rope_push", topics=tmp_path / "topics.toml")
    frames = [it for it in read_messages(tmp_path / "new.mcap", [Frame]) if isinstance(it, Frame)]
    assert len(frames) > 2
    assert {frame.camera.depth_unit_m for frame in frames} == {unit_m}
    read = [frame.depth * unit_m for frame in frames]
    for depth in read:
        nearest = min(np.abs(depth - away).max() for away in truth.values())
        assert nearest <= 0.51 * unit_m
    assert (max(depth.max() for depth in read) == pytest.approx(9.0)) == bool(far_m)


@pytest.mark.parametrize("suffix", ["ply", "npz", "npy"])
def test_files_of_points_of_every_kind_are_a_push(suffix: str, tmp_path: Path) -> None:
    import_(cloud_folder(tmp_path / "clouds", suffix), output=tmp_path / "new.mcap", task="rope_push")
    require_push(tmp_path / "new.mcap", 2e-3)


def test_what_is_in_a_folder_is_shown(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    import_(image_folder(tmp_path / "images"), show=True)
    text = capsys.readouterr().out
    assert "colour images" in text
    assert "depth images" in text
    assert 'color = "image"' in text


def line(number: int, text: str) -> Callable[[Path], None]:
    def edit(folder: Path) -> None:
        lines = (folder / "poses.csv").read_text(encoding="utf-8-sig").splitlines()
        lines[number] = text
        (folder / "poses.csv").write_text("\n".join(lines))

    return edit


BAD: list[tuple[Callable[[Path], object], str]] = [
    (line(0, "time,x,y,z,qx,qy,qz,image,depth"), "there is no 'qw'"),
    (line(3, "0.2,a,0,0,0,1,0,0,,"), "line 4: eight numbers"),
    (line(3, "0.2,0,0,0,0,2,0,0,,"), "line 4: it is no pose"),
    (line(3, "0.0,0,0,0,0,1,0,0,,"), "line 4: 0 s is not after"),
    (lambda folder: (folder / "poses.csv").write_text(",".join([*HEAD, "image", "depth"])), "holds no row"),
    (lambda folder: (folder / "poses.csv").write_bytes(b"\xff\xfe\0t"), "save it as CSV UTF-8"),
    (lambda folder: [file.unlink() for file in folder.glob("*5.png")], r"names \d*5.png, which cannot be read"),
    (lambda folder: [file.write_bytes(b"\x89PNG") for file in folder.glob("*5.png")], "is no image that can be read"),
    (
        lambda folder: [cv2.imwrite(str(file), np.zeros((240, 320), np.uint8)) for file in folder.glob("*_depth.png")],
        "16 bits",
    ),
]


@pytest.mark.parametrize(("damage", "said"), BAD)
def test_a_wrong_folder_is_refused_and_leaves_nothing(
    damage: Callable[[Path], object], said: str, tmp_path: Path
) -> None:
    folder = image_folder(tmp_path / "images")
    (tmp_path / "topics.toml").write_text(TOPICS)
    damage(folder)
    with pytest.raises(DipacError, match=said):
        import_(folder, output=tmp_path / "new.mcap", task="rope_push", topics=tmp_path / "topics.toml")
    assert not list(tmp_path.glob("*.mcap*"))


def test_a_camera_that_nobody_placed_is_said(tmp_path: Path) -> None:
    with pytest.raises(DipacError, match=r"put the calibration\.toml of `dipac calibration solve` into the folder"):
        import_(image_folder(tmp_path / "images"), output=tmp_path / "new.mcap", task="rope_push")
