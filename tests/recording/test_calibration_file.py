"""The file of cameras: what is written is read, cameras stay beside each other, and what is wrong is said in words."""

import tomllib
from dataclasses import replace
from datetime import date
from pathlib import Path

import numpy as np
import pytest
import tomli_w

from app.core.errors import RecordingError, UsageError
from app.core.geometry.charuco import Charuco
from app.core.geometry.hand_eye import HandEye, LastCheck, Spread
from app.core.geometry.lens import Lens
from app.recording.exchange.calibration_file import load_cameras, load_lens, note_check, save_camera


def camera(serial: str = "f1420001") -> HandEye:
    pose = np.eye(4)
    pose[:3, :3] = [[0, 0, 1], [1, 0, 0], [0, 1, 0]]
    pose[:3, 3] = [0.55, 0.61, 0.72]
    return HandEye(
        serial=serial,
        setup="fixed",
        pose=pose,
        board_pose=np.eye(4),
        lens=Lens(width=640, height=480, K=np.array([[605.0, 0, 319.5], [0, 604.0, 239.5], [0, 0, 1]])),
        board=Charuco(),
        calibrated_at=date(2026, 11, 23),
        views=18,
        outliers=2,
        error_px=0.4,
        error_m=0.0006,
        error_deg=0.05,
        deviation_m=(0.0003, 0.0002, 0.0004),
        deviation_deg=(0.03, 0.02, 0.03),
        spread=Spread(turns_deg=(24.0, 17.0, 13.0), shifts_m=(0.09, 0.05, 0.04)),
    )


def test_what_is_written_is_read_and_other_cameras_stay(tmp_path: Path) -> None:
    path = tmp_path / "calibration.toml"
    save_camera(path, camera())
    save_camera(path, replace(camera("b"), views=9))
    save_camera(path, replace(camera("b"), views=11))
    read = load_cameras(path)
    assert {serial: each.views for serial, each in read.items()} == {"b": 11, "f1420001": 18}
    first = read["f1420001"]
    np.testing.assert_allclose(first.pose, camera().pose, atol=1e-12)
    np.testing.assert_allclose(first.lens.K, camera().lens.K)
    assert (first.board, first.spread, first.calibrated_at) == (Charuco(), camera().spread, date(2026, 11, 23))
    model = first.model(depth_unit_m=0.001)
    assert (model.name, model.width, model.calibrated_at) == ("f1420001", 640, "2026-11-23")


def test_what_a_check_found_is_noted_beside_the_camera_and_told_with_it(tmp_path: Path) -> None:
    path = tmp_path / "calibration.toml"
    stood = LastCheck(day=date(2026, 12, 24), verdict="agrees", said="The calibration holds.")
    bent = LastCheck(day=date(2026, 12, 25), verdict="differs", said="The image is bent.")
    assert not note_check(path, "f1420001", place=stood)
    assert not path.exists()
    save_camera(path, camera())
    assert not note_check(path, "another", place=stood)
    assert load_cameras(path)["f1420001"].model(depth_unit_m=0.001).checked_at == ""
    assert note_check(path, "f1420001", place=stood)
    model = load_cameras(path)["f1420001"].model(depth_unit_m=0.001)
    assert (model.calibrated_at, model.checked_at, model.doubt) == ("2026-11-23", "2026-12-24", "")
    assert model.age_days(date(2026, 12, 30)) == 6
    assert note_check(path, "f1420001", optics=bent)
    both = load_cameras(path)["f1420001"]
    assert (both.place, both.optics) == (stood, bent)
    assert both.model(depth_unit_m=0.001).doubt == "checked on 2026-12-25: The image is bent."
    # Of intrinsics that agree nothing follows for where the camera stands.
    assert note_check(path, "f1420001", optics=replace(bent, verdict="agrees"))
    assert load_cameras(path)["f1420001"].model(depth_unit_m=0.001).checked_at == "2026-12-24"
    # One that is calibrated anew has not been checked.
    save_camera(path, camera())
    assert load_cameras(path)["f1420001"].place is None


def test_a_camera_that_the_program_cannot_use_is_refused_in_words() -> None:
    with pytest.raises(UsageError, match="wrist"):
        replace(camera(), setup="wrist").model(depth_unit_m=0.001)
    bent = replace(camera().lens, distortion=(-0.1, 0.0, 0.0, 0.0, 0.0))
    with pytest.raises(UsageError, match="bends its image by"):
        replace(camera(), lens=bent).model(depth_unit_m=0.001)


@pytest.mark.parametrize(
    ("keys", "value", "said"),
    [
        (("setup",), "ceiling", "Unknown setup"),
        (("calibrated_at",), "yesterday", "no day"),
        (("pose", "quaternion_wxyz"), [1.0, 1.0, 0.0, 0.0], "length"),
        (("pose", "translation_m"), [0.0, float("nan"), 0.0], "finite"),
        (("pose", "translation_m"), [0.0], "3 numbers"),
        (("intrinsics", "fx"), -3.0, "intrinsics"),
        (("intrinsics", "distortion"), "none", "5 numbers"),
        (("board", "square_m"), 7.0, "square_m"),
        (("checks",), {"place": {"day": "lately", "verdict": "agrees", "said": ""}}, "no day"),
        (("checks",), {"optics": {"day": date(2026, 11, 23), "verdict": "fine", "said": ""}}, "Unknown verdict"),
        (("quality", "views"), None, "lacks 'views'"),
    ],
)
def test_what_is_wrong_in_a_file_is_named(tmp_path: Path, keys, value, said) -> None:
    path = tmp_path / "calibration.toml"
    save_camera(path, camera())
    table = tomllib.loads(path.read_text(encoding="utf-8"))
    place = table["cameras"]["f1420001"]
    for key in keys[:-1]:
        place = place[key]
    if value is None:
        del place[keys[-1]]
    else:
        place[keys[-1]] = value
    path.write_text(tomli_w.dumps(table), encoding="utf-8")
    with pytest.raises(RecordingError, match=said) as refused:
        load_cameras(path)
    assert "f1420001" in str(refused.value)


@pytest.mark.parametrize(("text", "error"), [("schema = 9", RecordingError), ("]", RecordingError), (None, UsageError)])
def test_what_is_no_such_file_is_refused(tmp_path: Path, text, error) -> None:
    path = tmp_path / "calibration.toml"
    if text is not None:
        path.write_text(text, encoding="utf-8")
    for load in (load_cameras, load_lens):
        with pytest.raises(error, match="calibration"):
            load(path)
