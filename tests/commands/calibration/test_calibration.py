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


def copy_of(taken: tuple[Path, Cell], folder: Path) -> list[list[str]]:
    """A copy of the session; returns the rows of its table."""
    for path in taken[0].iterdir():
        (folder / path.name).write_bytes(path.read_bytes())
    return [line.split(",") for line in (folder / "poses.csv").read_text().splitlines()]


def write_table(folder: Path, rows: list[list[str]], *, delimiter: str = ",", encoding: str = "utf-8") -> None:
    text = "\n".join(delimiter.join(row) for row in rows) + "\n"
    (folder / "poses.csv").write_bytes(text.encode(encoding))


@pytest.mark.parametrize("kind", ["bom", "semicolons", "tabs", "heads", "folders", "suffixes"])
def test_tables_of_other_programs_are_read(kind: str, taken, tmp_path: Path, capsys) -> None:
    head, *rows = copy_of(taken, tmp_path)
    match kind:
        case "bom":
            write_table(tmp_path, [head, *rows], encoding="utf-8-sig")
        case "semicolons":
            commas = [[row[0], *(each.replace(".", ",") for each in row[1:])] for row in rows]
            write_table(tmp_path, [head, *commas], delimiter=";")
        case "tabs":
            write_table(tmp_path, [head, *rows], delimiter="\t")
        case "heads":
            write_table(tmp_path, [[f" {name.upper()}" for name in head], *rows])
        case "folders":
            write_table(tmp_path, [head, *([f"images/{row[0]}", *row[1:]] for row in rows)])
        case _:
            write_table(tmp_path, [head, *([row[0].removesuffix(".png"), *row[1:]] for row in rows)])
    assert "7 views miss it by" in said(capsys, "solve", tmp_path, "-o", tmp_path / "c.toml")


def test_a_table_without_poses_or_in_millimetres_is_told(taken, tmp_path: Path, capsys) -> None:
    head, *rows = copy_of(taken, tmp_path)
    write_table(tmp_path, [head])
    assert "no pose" in refused(capsys, 4, "solve", tmp_path, "-o", tmp_path / "c.toml")
    write_table(tmp_path, [head, *([row[0], *(f"{1e3 * float(it)}" for it in row[1:4]), *row[4:]] for row in rows)])
    assert "give metres, not millimetres" in refused(capsys, 4, "solve", tmp_path, "-o", tmp_path / "c.toml")
    write_table(tmp_path, [head, *(["none.png", *row[1:]] for row in rows)])
    assert "none.png" in refused(capsys, 2, "solve", tmp_path, "-o", tmp_path / "c.toml")


def test_an_image_that_is_cut_empty_or_gone_is_left_out_by_name(taken, tmp_path: Path, capsys) -> None:
    head, *rows = copy_of(taken, tmp_path)
    more = [[name, *rows[0][1:]] for name in ("cut.png", "empty.png", "gone.png")]
    write_table(tmp_path, [head, *rows, *more])
    (tmp_path / "cut.png").write_bytes((tmp_path / "0.png").read_bytes()[:5000])
    (tmp_path / "empty.png").write_bytes(b"")
    told = said(capsys, "solve", tmp_path, "-o", tmp_path / "c.toml")
    for name, *_ in more:
        assert f"{name} is left out: Cannot read the image" in told
    assert "7 views miss it by" in told


@pytest.mark.parametrize(
    ("mistake", "words"),
    [("order", "correct the heads"), ("inverse", "give the inverse"), ("shifted", "move them up")],
)
def test_a_usual_mistake_in_the_poses_is_found_by_trying(mistake, words, taken, tmp_path: Path, capsys) -> None:
    head, *rows = copy_of(taken, tmp_path)
    if mistake == "order":
        rows = [[*row[:4], *row[5:], row[4]] for row in rows]
    elif mistake == "shifted":
        rows = [[row[0], *rows[index - 1][1:]] for index, row in enumerate(rows)]
    else:
        for row in rows:
            x, y, z, *turn = map(float, row[1:])
            back = Rotation.from_quat(turn, scalar_first=True).inv()
            row[1:] = [f"{each:.9g}" for each in (*-back.apply([x, y, z]), *back.as_quat(scalar_first=True))]
    write_table(tmp_path, [head, *rows])
    assert words in refused(capsys, 5, "solve", tmp_path, "-o", tmp_path / "c.toml")
    assert not (tmp_path / "c.toml").exists()


def test_the_other_set_up_is_named(taken, tmp_path: Path, capsys) -> None:
    out = tmp_path / "c.toml"
    assert "or --setup is the other one" in refused(capsys, 5, "solve", taken[0], "--setup", "wrist", "-o", out)
