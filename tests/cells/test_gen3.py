"""A real cell before its cameras are calibrated, and where their calibration is kept."""

from dataclasses import replace
from pathlib import Path

import anyio
import numpy as np
import pytest

from app.cells import gen3
from app.core.geometry.table_place import TablePlace
from app.recording.exchange.calibration_file import load_cameras, save_camera
from tests.cells.test_cell_file import GOOD, written
from tests.recording.test_calibration_file import camera


def test_cameras_that_are_not_calibrated_are_opened_without_a_date_which_is_said(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    file = written(tmp_path, GOOD)
    save_camera(tmp_path / "calibration.toml", camera("012345678901"))
    _, (left, right) = gen3._cell_and_cameras(file)
    assert (left.calibrated_at, right.calibrated_at) == ("2026-11-23", "")
    np.testing.assert_allclose(left.T_world_camera, camera().pose, atol=1e-12)
    said = capsys.readouterr().err
    assert "where camera 'right' (012345678902) stands" in said
    assert "'left'" not in said


def test_a_calibration_made_in_the_console_lies_beside_the_cells_file_by_the_cameras_serial(
    tmp_path: Path,
) -> None:
    file = written(tmp_path, GOOD)
    shelf = gen3.CELL.shelf(file)
    assert anyio.run(shelf.kept, "right") is None
    assert anyio.run(shelf.keep, camera("right")) == tmp_path / "calibration.toml"
    assert set(load_cameras(tmp_path / "calibration.toml")) == {"012345678902"}
    kept = anyio.run(shelf.kept, "right")
    assert kept is not None
    anyio.run(shelf.keep, kept)
    assert set(load_cameras(tmp_path / "calibration.toml")) == {"012345678902"}
    _, (_, right) = gen3._cell_and_cameras(file)
    assert right.calibrated_at == "2026-11-23"


def test_a_calibration_is_kept_in_the_frame_of_the_base_and_used_in_that_of_a_table_somewhere_else(
    tmp_path: Path,
) -> None:
    own, table = camera("012345678901"), TablePlace(place_m=(0.1, -0.2, -0.15), turn_deg=30.0)
    moved = GOOD.replace("place_m = [0.0, 0.0, 0.0]\nturn_deg = 0.0", "place_m = [0.1, -0.2, -0.15]\nturn_deg = 30.0")
    file = written(tmp_path, moved)
    save_camera(tmp_path / "calibration.toml", own)
    _, (left, _) = gen3._cell_and_cameras(file)
    np.testing.assert_allclose(table.base_from_table @ left.T_world_camera, own.pose, atol=1e-9)
    shelf = gen3.CELL.shelf(file)
    kept = anyio.run(shelf.kept, "left")
    assert kept is not None
    np.testing.assert_allclose(kept.pose, left.T_world_camera, atol=1e-9)
    anyio.run(shelf.keep, replace(kept, serial="left"))
    again = load_cameras(tmp_path / "calibration.toml")["012345678901"]
    np.testing.assert_allclose(again.pose, own.pose, atol=1e-6)
