"""A real cell's file says all that is needed, and everything that is wrong with one is said in words."""

import re
from pathlib import Path

import numpy as np
import pytest

from app import cells
from app.cells.cell_file import far_corner, limits, load_cell
from app.config import KeepOut, Limits, Site, Workspace
from app.core.errors import RecordingError, UsageError
from app.core.geometry.table_place import TablePlace
from app.core.motion import pointing_down
from app.rig.kinova.gen3 import GRIPPER_M, reach
from tests.conftest import ROOT

PAGE = (ROOT / "docs" / "real-cell.md").read_text(encoding="utf-8")
GOOD = PAGE.split("```toml\n")[1].split("```")[0]


def written(folder: Path, text: str) -> Path:
    file = folder / "cell.toml"
    file.write_text(text, encoding="utf-8")
    return file


def test_the_file_on_the_page_is_one(tmp_path: Path) -> None:
    cell = load_cell(written(tmp_path, GOOD))
    assert [camera.name for camera in cell.cameras] == ["left", "right"]
    assert limits(cell) == Limits(
        speed_m_s=0.10,
        acceleration_m_s2=0.5,
        angular_speed_rad_s=0.5,
        force_n=30.0,
        gripper_ma=300.0,
        reach=reach(0.163),
        workspace=Workspace(low=(0.30, -0.25, 0.02), high=(0.55, 0.25, 0.25)),
        keep_out=(KeepOut(name="camera stand", low=(0.60, 0.22, 0.0), high=(0.75, 0.35, 0.40)),),
    )


def test_a_corner_that_the_arm_does_not_reach_is_said_and_is_no_mistake(tmp_path: Path) -> None:
    assert far_corner(load_cell(written(tmp_path, GOOD))) == ""
    box = "low = [0.30, -0.25, 0.02], high = [0.55, 0.25, 0.25]"
    far = GOOD.replace(box, "low = [0.30, -0.30, 0.02], high = [0.70, 0.30, 0.40]")
    assert "'bench 1' is 152 mm further away" in far_corner(load_cell(written(tmp_path, far)))


@pytest.mark.parametrize(
    ("was", "becomes", "said"),
    [
        ("schema = 1", "schema = 2", "schema 2"),
        ("speed_m_s = 0.10", "speed_m_s = 0.31", "speed_m_s"),
        ("speed_m_s = 0.10", "speed_m_s = nan", "speed_m_s"),
        ("[[limits.keep_out]]", "[[limits.keepout]]", "unknown field `keepout`"),
        ("[[limits.keep_out]]", "[[limits.keepout]]", "Did you mean 'keep_out'?"),
        ("travel_height_m", "travel_hight_m", "Did you mean 'travel_height_m'?"),
        ('client = "dipac"', 'client = "kortex"', "client is 'kortex', and there are dipac, kortex_api"),
        ("low = [0.60, 0.22, 0.0]", "low = [0.60, 0.22]", "low"),
        ("low = [0.60, 0.22, 0.0]", "low = [0.80, 0.22, 0.0]", "'camera stand'"),
        ("high = [0.55, 0.25, 0.25] }", "high = [inf, 0.25, 0.25] }", "'workspace'"),
        ("travel_height_m = 0.15", "travel_height_m = 0.5", "travel_height_m"),
        ('"012345678902"', '"012345678901"', "same serial"),
        ('name = "right"', 'name = "left"', "same name"),
        ('[[cameras]]\nname = "right"\nserial = "012345678902"', "", "1 cameras"),
        ("[arm]", "[arm", "describes no cell"),
        ("tip_m = 0.163", "tip_m = 163.0", "tip_m"),
        ("gripper_ma = 300.0", "gripper_ma = 0.0", "gripper_ma"),
        ("low = [0.30, -0.25, 0.02], high = [0.55,", "low = [0.60, -0.30, 0.02], high = [0.99,", "mm further away"),
        ("turn_deg = 90.0", "turn_deg = nan", "turn_deg"),
    ],
)
def test_what_is_wrong_with_a_file_is_said(tmp_path: Path, was: str, becomes: str, said: str) -> None:
    assert was in GOOD
    file = written(tmp_path, GOOD.replace(was, becomes))
    with pytest.raises(RecordingError, match=re.escape(said)) as error:
        load_cell(file)
    assert str(file) in str(error.value)


def test_a_file_that_is_not_there_is_said(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="real-cell"):
        load_cell(tmp_path / "none.toml")


def test_the_site_of_a_real_cell_has_the_limits_of_its_file_and_the_slower_speed(tmp_path: Path) -> None:
    file, gen3 = written(tmp_path, GOOD), cells.load("gen3")
    assert gen3.narrowed(Site(), file).limits == limits(load_cell(file))
    assert gen3.narrowed(Site(), file).travel_height_m == 0.15
    slow = Site(limits=Limits(speed_m_s=0.05))
    assert gen3.narrowed(slow, file).limits.speed_m_s == 0.05


def test_a_real_cell_needs_a_file_and_a_simulated_one_none(tmp_path: Path) -> None:
    with pytest.raises(UsageError, match="--cell"):
        cells.load("gen3").narrowed(Site(), None)
    assert cells.load("simulated").narrowed(Site(), None) == Site()
    assert cells.load("rehearsal").narrowed(Site(), None) == Site(limits=Limits(reach=reach(GRIPPER_M)))
    with pytest.raises(UsageError, match="real cell"):
        cells.load("simulated").narrowed(Site(), tmp_path / "cell.toml")


def test_a_table_somewhere_else_is_where_the_file_says_and_the_arm_reaches_as_far(tmp_path: Path) -> None:
    moved = GOOD.replace("place_m = [0.0, 0.0, 0.0]\nturn_deg = 0.0", "place_m = [0.1, -0.2, -0.15]\nturn_deg = 30.0")
    file = written(tmp_path, moved)
    for name, tip_m in (("gen3", 0.163), ("rehearsal", GRIPPER_M)):
        site = cells.load(name).narrowed(Site(), file)
        assert site.table == TablePlace(place_m=(0.1, -0.2, -0.15), turn_deg=30.0)
        assert site.limits.workspace == limits(load_cell(file)).workspace
        assert site.limits.reach is not None
        own = reach(tip_m)
        # A tool that points down is as far out of reach, whichever of the frames says where it is.
        place = np.array([0.5, 0.1, 0.05])
        there = site.table.base_from_table[:3, :3] @ place + site.table.place_m
        here_m, there_m = site.limits.reach.beyond_m(pointing_down(place)), own.beyond_m(pointing_down(there))
        assert here_m == pytest.approx(there_m)
    far = moved.replace("place_m = [0.1, -0.2, -0.15]", "place_m = [0.6, -0.2, -0.15]")
    with pytest.raises(RecordingError, match="further away than the arm reaches"):
        load_cell(written(tmp_path, far))
    with pytest.raises(RecordingError, match="place_m"):
        load_cell(written(tmp_path, moved.replace("-0.15]", "inf]")))


def test_an_unknown_rig_is_answered_with_those_there_are() -> None:
    assert cells.names() == ["gen3", "rehearsal", "replayed", "simulated"]
    with pytest.raises(UsageError, match="Did you mean 'rehearsal'"):
        cells.load("rehersal")


def test_a_file_of_other_bytes_than_text_is_said(tmp_path: Path) -> None:
    file = tmp_path / "cell.toml"
    file.write_bytes(GOOD.replace("bench", "Prüfstand").encode("latin-1"))
    with pytest.raises(RecordingError, match="describes no cell"):
        load_cell(file)
