"""`dipac calibration`, as a user types it: a board is made, intrinsics are checked, and a camera is found and kept."""

from datetime import UTC, datetime
from pathlib import Path

import numpy as np
import pytest
from PIL import Image
from scipy.spatial.transform import Rotation

from app.__main__ import main
from app.recording.exchange.calibration_file import load_cameras
from bench.boards import Camera, Cell, Errors, cell, image, off, reported

LENS = (
    "width = 640\nheight = 480\nfx = 605.0\nfy = 603.0\ncx = 319.5\ncy = 239.5\ndistortion = [0.0, 0.0, 0.0, 0.0, 0.0]"
)


@pytest.fixture(scope="module")
def taken(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, Cell]:
    """A folder with eight views, the last of which shows no board."""
    folder, truth, rng = tmp_path_factory.mktemp("views"), cell(0, 8), np.random.default_rng(0)
    (folder / "camera.toml").write_text(f'serial = "f1420001"\n[intrinsics]\n{LENS}\n', encoding="utf-8")
    rows = ["image,x,y,z,qw,qx,qy,qz"]
    for index, (C, told) in enumerate(zip(truth.C, reported(truth, rng, Errors()), strict=True)):
        taken = image(C, Camera(), rng) if index < 7 else np.full((480, 640, 3), 90, np.uint8)
        Image.fromarray(taken).save(folder / f"{index}.png")
        turn = Rotation.from_matrix(told[:3, :3]).as_quat(scalar_first=True)
        rows.append(",".join([f"{index}.png", *(f"{each:.9g}" for each in (*told[:3, 3], *turn))]))
    (folder / "poses.csv").write_text("\n".join(rows) + "\n", encoding="utf-8")
    return folder, truth


def said(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert main(["calibration", *map(str, arguments)]) == 0
    return capsys.readouterr().out


def refused(capsys: pytest.CaptureFixture[str], code: int, *arguments: object) -> str:
    assert main(["calibration", *map(str, arguments)]) == code
    return capsys.readouterr().err


def test_a_board_is_written_in_the_format_that_its_name_says(tmp_path: Path, capsys) -> None:
    for suffix, begins in ((".pdf", b"%PDF"), (".svg", b"<?xml")):
        file = tmp_path / f"board{suffix}"
        assert "100 %" in said(capsys, "board", "-o", file)
        assert file.read_bytes().startswith(begins)
    assert ".pdf" in refused(capsys, 2, "board", "-o", tmp_path / "board.doc")
    assert "marker_m" in refused(capsys, 2, "board", "-o", tmp_path / "b.svg", "--board.marker-m", "0.05")


def test_intrinsics_are_compared(taken, tmp_path: Path, capsys) -> None:
    shown = said(capsys, "check", taken[0], "--kept", tmp_path / "none.toml")
    assert "noted" not in shown
    assert "7.png is left out: The image has no contrast" in shown
    assert "agree with 7 views" in shown
    assert "pixels  maker" in shown


def test_a_camera_is_found_and_kept_and_compared_with_what_was_kept(taken, tmp_path: Path, capsys) -> None:
    folder, truth = taken
    file = tmp_path / "calibration.toml"
    shown = said(capsys, "solve", folder, "-o", file)
    assert "Standard deviations" in shown
    assert "One more view would tell most" in shown or "No other pose" in shown
    wrong_mm, wrong_deg = off(load_cameras(file)["f1420001"].pose, truth)
    assert wrong_mm < 2.0
    assert wrong_deg < 0.2
    assert "moved by 0.0 mm" in said(capsys, "solve", folder, "-o", file)
    assert "noted beside camera 'f1420001'" in said(capsys, "check", folder, "--kept", file)
    noted = load_cameras(file)["f1420001"].optics
    assert noted is not None
    assert (noted.verdict, noted.day) == ("agrees", datetime.now(UTC).date())


def test_what_is_missing_is_named(taken, tmp_path: Path, capsys) -> None:
    assert "camera.toml: No such file or directory; docs/" in refused(capsys, 2, "check", tmp_path)
    (tmp_path / "camera.toml").write_text('serial = "a"', encoding="utf-8")
    assert "intrinsics" in refused(capsys, 4, "check", tmp_path)
    for name in ("camera.toml", "0.png"):
        (tmp_path / name).write_bytes((taken[0] / name).read_bytes())
    assert "its first line is image,x,y,z,qw" in refused(capsys, 2, "solve", tmp_path, "-o", tmp_path / "c.toml")
    for table, words in (
        ("x,y\n1,2\n", "names its columns"),
        ("image,x,y,z,qw,qx,qy,qz\n0.png,0,0,0,1,1,0,0\n", "line 2"),
        ("image,x,y,z,qw,qx,qy,qz\n0.png,0,0\n", "line 2"),
    ):
        (tmp_path / "poses.csv").write_text(table, encoding="utf-8")
        assert words in refused(capsys, 4, "solve", tmp_path, "-o", tmp_path / "c.toml")
    (tmp_path / "poses.csv").write_text("image,x,y,z,qw,qx,qy,qz\n0.png,0,0,0,1,0,0,0\n", encoding="utf-8")
    assert "There is 1 view and" in refused(capsys, 5, "solve", tmp_path, "-o", tmp_path / "c.toml")
    assert not (tmp_path / "c.toml").exists()
