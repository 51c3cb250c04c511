"""Frames: bits where Kinova puts them, whole however a stream is cut, and one error for everything else."""

import struct

import pytest
from hypothesis import given
from hypothesis import strategies as st

from app.rig.kinova.api.errors import WireError
from app.rig.kinova.client.wire import LONGEST_FRAME, MAGIC, FrameKind, KortexFrame, Splitter, decode_frame

FRAMES = st.builds(
    KortexFrame,
    kind=st.integers(0, 15),
    service=st.integers(0, 0xFFF),
    function=st.integers(0, 0xFFFF),
    session=st.integers(0, 0xFFFF),
    message=st.integers(0, 0xFFFF),
    device=st.integers(0, 0xFF),
    error=st.integers(0, 0xF),
    sub_error=st.integers(0, 0xFFF),
    payload=st.binary(max_size=32),
)


def test_the_bits_of_a_request_stand_where_the_protocol_says() -> None:
    frame = KortexFrame(
        kind=FrameKind.REQUEST, service=2, function=0x79, session=0x1234, message=0xABCD, payload=b"\x08\x01"
    )
    words = (0x11000000, 0x1234ABCD, 0x10020079, 0x00000002)
    header = b"".join(bytes([number << 3 | 5]) + struct.pack("<I", word) for number, word in enumerate(words, start=1))
    assert frame.encode() == b"\x0a\x14" + header + b"\x12\x02\x08\x01"


def test_the_bits_of_an_error_stand_where_the_protocol_says() -> None:
    frame = KortexFrame(kind=FrameKind.RESPONSE, error=3, sub_error=130)
    assert frame.encode()[3:7] == struct.pack("<I", 0x13003082)


def test_a_frame_on_a_stream_begins_with_magic_and_length() -> None:
    framed = KortexFrame(kind=FrameKind.PING).encode_for_stream()
    assert framed[:8] == bytes([7]) + b"xEtRoK" + bytes([7])
    assert struct.unpack(">I", framed[8:12]) == (len(framed) - 12,)


@given(FRAMES)
def test_a_frame_is_read_as_it_was_written(frame: KortexFrame) -> None:
    assert decode_frame(frame.encode()) == frame


@given(st.lists(FRAMES, max_size=4), st.lists(st.integers(1, 50), max_size=20))
def test_frames_are_found_however_the_stream_is_cut(frames: list[KortexFrame], cuts: list[int]) -> None:
    stream, splitter, found = b"".join(frame.encode_for_stream() for frame in frames), Splitter(), []
    for cut in cuts:
        found += splitter.feed(stream[:cut])
        stream = stream[cut:]
    found += splitter.feed(stream)
    assert [decode_frame(each) for each in found] == frames


@given(st.binary(max_size=80))
def test_hostile_datagrams_are_a_frame_or_one_error(data: bytes) -> None:
    try:
        frame = decode_frame(data)
    except WireError:
        return
    assert isinstance(frame, KortexFrame)


@given(st.lists(st.binary(max_size=40), max_size=4), st.booleans())
def test_hostile_streams_are_frames_or_one_error(pieces: list[bytes], begins_well: bool) -> None:
    splitter = Splitter()
    try:
        for piece in [MAGIC] * begins_well + pieces:
            splitter.feed(piece)
    except WireError:
        return


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"HTTP/1.1 200 OK", "is this a Kinova arm"),
        (MAGIC[:3] + b"?", "is this a Kinova arm"),
        (MAGIC + struct.pack(">I", LONGEST_FRAME + 1), "claims"),
    ],
)
def test_another_protocol_or_a_monstrous_length_is_refused_at_once(data: bytes, says: str) -> None:
    with pytest.raises(WireError, match=says):
        Splitter().feed(data)


def test_a_frame_without_header_and_one_of_another_version_are_refused() -> None:
    with pytest.raises(WireError, match="no header"):
        decode_frame(b"")
    other = bytearray(KortexFrame(kind=FrameKind.PING).encode())
    other[6] = 0x20 | other[6] & 0x0F
    with pytest.raises(WireError, match="version 2"):
        decode_frame(bytes(other))


def test_what_does_not_fit_its_bits_is_not_sent() -> None:
    with pytest.raises(WireError, match="session 65536"):
        KortexFrame(kind=FrameKind.REQUEST, session=1 << 16).encode()
