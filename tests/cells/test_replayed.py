"""A recording as a cell: what is wrong with one is said, the arm obeys, and what is seen does not answer to it."""

import json
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path

import anyio
import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from app import cells
from app.cells import replayed
from app.cells.base import Wanted
from app.config import Site
from app.core.errors import UsageError
from app.core.geometry.scene_description import Stage
from app.core.geometry.table_place import AT_BASE, TablePlace
from app.core.messages import ArmState, Episode
from app.rig.kinova import gen3
from tests.recording.films import filmed, frames, states
from tests.recording.samples import Maker
from tests.rig.scene import FINGER, ROPE, approved, push, straight_rope

REPLAYED = cells.load("replayed")
WANTED = Wanted(stage=Stage(body=ROPE, tool=FINGER), start=straight_rope(), site=Site(), seed=0)


def recorded(folder: Path, *cameras: str) -> Path:
    make = Maker(seed=6)
    return filmed(folder / f"cell{len(cameras)}.mcap", frames({name: [0.0, 0.3] for name in cameras}, make), make)


def test_its_site_is_as_it_is_and_it_needs_a_recording(tmp_path: Path) -> None:
    assert REPLAYED.narrowed(Site(), recorded(tmp_path, "left", "right")) == Site()
    with pytest.raises(UsageError, match=r"--cell RECORDING\.mcap"):
        REPLAYED.narrowed(Site(), None)


def test_a_file_that_cannot_be_shown_is_refused_with_the_reason(tmp_path: Path) -> None:
    text = tmp_path / "text.mcap"
    text.write_text("not a recording")
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(recorded(tmp_path, "left", "right").read_bytes()[:-100])
    reasons = {
        tmp_path / "nowhere.mcap": "Unknown recording",
        text: "not an MCAP file",
        cut: "dipac recover",
    }
    for file, reason in reasons.items():
        with pytest.raises(UsageError, match=reason):
            REPLAYED.narrowed(Site(), file)
    with pytest.raises(UsageError, match="holds no images"):
        REPLAYED.narrowed(Site(), recorded(tmp_path))
    with pytest.raises(UsageError, match="has one camera, 'left'"):
        REPLAYED.narrowed(Site(), recorded(tmp_path, "left"))


@pytest.mark.anyio
async def test_its_arm_moves_and_its_cameras_go_on_showing_what_was_recorded(tmp_path: Path) -> None:
    file = await anyio.to_thread.run_sync(recorded, tmp_path, "left", "right")
    async with REPLAYED.open(replace(WANTED, file=file)) as rig:
        assert rig.simulated
        assert rig.name == "replayed"
        assert not REPLAYED.answers
        assert [camera.model.name for camera in rig.cameras] == ["left", "right"]
        executed = await rig.arm.execute(approved(push((0.44, 0.0), (0.46, 0.0))))
        assert executed.outcome == "completed", executed.reason
        seen = [await rig.cameras[0].read() for _ in range(3)]
        assert {int(frame.depth[0, 0]) for frame in seen} <= {1, 2}
        assert seen[-1].time_s > executed.times_s[-1]
        assert np.isfinite((await rig.arm.state()).joints).all()


@pytest.mark.anyio
@pytest.mark.parametrize(("rig", "known"), [("simulated", True), ("replayed", False), ("some rig", False)])
async def test_what_hides_the_object_is_the_arm_in_the_images_and_not_the_one_that_moves(
    tmp_path: Path, rig: str, *, known: bool
) -> None:
    make = Maker(seed=6)
    there = [
        replace(state, joints=np.full(7, 0.1), pose=np.array([0.6, 0.2, 0.1, 0.0, 1.0, 0.0, 0.0]), opening_m=0.0)
        for state in states([0.0, 0.5], make)
    ]
    taken = frames({"left": [0.1, 0.4], "right": [0.1, 0.4]}, make)
    messages = sorted([*taken, *there], key=lambda message: message.time_s)
    file = await anyio.to_thread.run_sync(partial(filmed, tmp_path / "cell.mcap", messages, make, rig=rig))
    async with REPLAYED.open(replace(WANTED, file=file)) as cell:
        assert (cell.shape is not None) == known
        await cell.cameras[0].read()
        assert cell.seen_arm.tool()[:3] == pytest.approx([0.6, 0.2, 0.1])
        assert cell.seen_arm.joints() == pytest.approx(np.full(7, 0.1))
        assert np.linalg.norm(cell.arm.tool()[:3] - [0.6, 0.2, 0.1]) > 0.1


def test_an_arm_is_in_the_images_where_it_stood_beside_the_table_that_the_recording_names() -> None:
    """A tool's tip that is recorded in the table's frame is where the drawn arm has it."""
    make = Maker(seed=6)
    table = TablePlace(place_m=(0.05, -0.2, -0.15), turn_deg=30.0)
    said = replayed._table(make(Episode, config=json.dumps({"table": asdict(table)})))
    assert said == table
    assert replayed._table(make(Episode, config="{}")) == replayed._table(make(Episode, config="?")) == AT_BASE
    with pytest.raises(UsageError, match="its table is at 'here', and needs place_m"):
        replayed._table(make(Episode, config=json.dumps({"table": "here"})))
    tip = gen3.tool(gen3.HOME)
    pose = np.array([*tip[:3, 3], *Rotation.from_matrix(tip[:3, :3]).as_quat(scalar_first=True)])
    state = replace(make(ArmState), joints=gen3.HOME, pose=table.poses_in_table(pose))
    looks = cells.load("gen3").pictured
    assert looks is not None
    here, there = (looks(FINGER, each, place) for each, place in ((replace(state, pose=pose), AT_BASE), (state, table)))
    base_from_table = table.base_from_table
    assert base_from_table @ there.links(gen3.HOME) == pytest.approx(here.links(gen3.HOME), abs=1e-9)
    assert there.limbs == here.limbs


@pytest.mark.anyio
async def test_no_recorded_gripper_holds_a_board(tmp_path: Path) -> None:
    file = await anyio.to_thread.run_sync(recorded, tmp_path, "left", "right")
    with pytest.raises(UsageError, match="--board"):
        async with REPLAYED.open(replace(WANTED, file=file, board=True)):
            pass
