"""Drawing of the site, as its scene goes to a browser."""

import numpy as np
import pytest
import viser
import zstandard

from app.config import KeepOut, Limits
from app.core.geometry.table_place import AT_BASE, TablePlace
from app.ui.parts import palette
from app.ui.view.scene import ConsoleScene
from app.ui.view.tool import DrawnGripper, Flat

_HEADER_BYTES = 8
"""Length of the header before the packed scene: its size, unpacked."""


def drawn(limits: Limits, table: TablePlace = AT_BASE) -> bytes:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        ConsoleScene(server, limits, table)
        packed = server.get_scene_serializer().serialize()
    finally:
        server.stop()
    return zstandard.ZstdDecompressor().decompressobj().decompress(packed[_HEADER_BYTES:])


def drawn_tool(task: str) -> bytes:
    """Packed scene of a tool that was two fingers and became the one of that task."""
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        tool = DrawnGripper(server, "/tool", palette.STEEL, opacity=None)
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
def test_a_volume_that_is_kept_free_is_drawn_with_its_name() -> None:
    stand = KeepOut(name="camera stand", low=(0.6, 0.2, 0.0), high=(0.7, 0.3, 0.4))
    assert b"camera stand" in drawn(Limits(keep_out=(stand,)))
    assert b"kept_free" not in drawn(Limits())
