"""What is drawn of the site, as its scene goes to a browser."""

import pytest
import viser
import zstandard

from app.config import KeepOut, Limits
from app.ui.scene import Scene

_HEADER_BYTES = 8
"""Before the packed scene stands its size, unpacked."""


def drawn(limits: Limits) -> bytes:
    server = viser.ViserServer(host="127.0.0.1", port=0, verbose=False)
    try:
        Scene(server, limits)
        packed = server.get_scene_serializer().serialize()
    finally:
        server.stop()
    return zstandard.ZstdDecompressor().decompressobj().decompress(packed[_HEADER_BYTES:])


@pytest.mark.serial
def test_a_volume_that_is_kept_free_is_drawn_with_its_name() -> None:
    stand = KeepOut(name="camera stand", low=(0.6, 0.2, 0.0), high=(0.7, 0.3, 0.4))
    assert b"camera stand" in drawn(Limits(keep_out=(stand,)))
    assert b"kept_free" not in drawn(Limits())
