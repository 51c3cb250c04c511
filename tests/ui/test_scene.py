"""Drawing of the site, as its scene goes to a browser."""

import numpy as np
import pytest
import viser
import zstandard
from scipy.spatial.transform import Rotation

from app.config import KeepOut, Limits
from app.core.geometry.scene_description import Stage
from app.core.geometry.shapes.tools import Gripper
from app.core.geometry.table_place import AT_BASE, TablePlace
from app.core.motion import TOOL_DOWN
from app.tasks import load
from app.ui.parts import palette
from app.ui.view.scene import ConsoleScene
from app.ui.view.tool import DrawnTool, Flat

_HEADER_BYTES = 8
"""Length of the header before the packed scene: its size, unpacked."""


def drawn(limits: Limits, table: TablePlace = AT_BASE, stage: Stage | None = None) -> bytes:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        scene = ConsoleScene(server, limits, table, stage)
        scene.tool.put(np.array([0.5, 0.0, 0.2, 0.0, 1.0, 0.0, 0.0]), 0.0)
        packed = server.get_scene_serializer().serialize()
    finally:
        server.stop()
    return zstandard.ZstdDecompressor().decompressobj().decompress(packed[_HEADER_BYTES:])


def drawn_tool(task: str) -> bytes:
    """Packed scene of a tool that was two fingers and became the one of that task."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        tool = DrawnTool(server, "/tool", palette.STEEL, opacity=None)
        tool.put(np.zeros(3), 1.0)
        tool.become(Flat.of(task))
        tool.put(np.zeros(3), 1.0)
        packed = server.get_scene_serializer().serialize()
    finally:
        server.stop()
    return zstandard.ZstdDecompressor().decompressobj().decompress(packed[_HEADER_BYTES:])


@pytest.mark.serial
def test_a_flat_finger_is_drawn_as_one_plate_and_a_round_one_as_two_fingers() -> None:
    flat = drawn_tool("rope_push(finger_half_width_m=0.02,finger_yaw_rad=0.5)")
    assert b"/tool/finger_flat" in flat
    assert b"/tool/finger_left" in drawn_tool("rope_push(finger_radius_m=0.006)")


@pytest.mark.serial
def test_the_arm_stands_where_it_does_beside_the_table() -> None:
    """The base is half a metre before the table's origin, and turned by a quarter."""
    there = TablePlace(place_m=(0.5, 0.0, -0.125), turn_deg=90.0)
    base = np.float32([0.0, 0.5, 0.125])
    assert there.table_from_base[:3, 3] == pytest.approx(base)
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        ConsoleScene(server, Limits(), there)
        handle = server.scene.get_handle_by_name("/base")
        assert isinstance(handle, viser.FrameHandle)
        assert handle.position == pytest.approx(base)
        assert np.abs(handle.wxyz) == pytest.approx(np.sqrt([0.5, 0, 0, 0.5]))
        assert handle.wxyz[0] * handle.wxyz[3] < 0
    finally:
        server.stop()


@pytest.mark.serial
@pytest.mark.parametrize(
    ("task", "parts"),
    [
        ("pour_water", (b"/fixtures/0", b"/tool/bowl")),
        ("cloth_hang", (b"/fixtures/0", b"/tool/finger_left")),
        ("bean_sweep", (b"/fixtures/0", b"/tool/board")),
    ],
)
def test_what_stands_on_the_table_is_drawn_and_the_tool_as_it_is(task: str, parts: tuple[bytes, ...]) -> None:
    scene = drawn(Limits(), stage=load(task).stage)
    assert all(part in scene for part in parts)
    assert b"/fixtures" not in drawn(Limits())


@pytest.mark.serial
def test_the_tool_is_turned_as_the_arm_has_it() -> None:
    """A bowl that leans by a third of a turn about x."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        scene = ConsoleScene(server, Limits(), stage=load("pour_water").stage)
        leans = Rotation.from_rotvec([2 * np.pi / 3, 0.0, 0.0])
        turn = leans * Rotation.from_quat(TOOL_DOWN, scalar_first=True)
        scene.tool.put(np.array([0.5, 0.0, 0.2, *turn.as_quat(scalar_first=True)]), 0.0)
        handle = server.scene.get_handle_by_name("/tool")
        assert isinstance(handle, viser.FrameHandle)
        drawn_turn = Rotation.from_quat(handle.wxyz, scalar_first=True)
        assert (drawn_turn * leans.inv()).magnitude() == pytest.approx(0.0, abs=1e-6)
    finally:
        server.stop()


@pytest.mark.serial
@pytest.mark.parametrize(("closed", "apart_m"), [(0.0, 0.08), (1.0, 0.0)])
def test_the_fingers_of_a_gripper_are_as_far_apart_as_it_opens(closed: float, apart_m: float) -> None:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        tool = Gripper(half_m=(0.01, 0.005, 0.03), opening_m=0.08, closed_m=0.006)
        DrawnTool(server, "/tool", palette.STEEL, opacity=None, tool=tool).put(np.zeros(3), closed)
        left, right = (server.scene.get_handle_by_name(f"/tool/finger_{side}") for side in ("left", "right"))
        assert isinstance(left, viser.BoxHandle)
        assert isinstance(right, viser.BoxHandle)
        assert right.position - left.position == pytest.approx([0.0, apart_m + 0.01, 0.0])
    finally:
        server.stop()


@pytest.mark.serial
def test_a_volume_that_is_kept_free_is_drawn_with_its_name() -> None:
    stand = KeepOut(name="camera stand", low=(0.6, 0.2, 0.0), high=(0.7, 0.3, 0.4))
    assert b"camera stand" in drawn(Limits(keep_out=(stand,)))
    assert b"kept_free" not in drawn(Limits())
