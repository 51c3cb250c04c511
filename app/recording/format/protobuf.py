"""Extraction of one field from a protobuf message.

Foxglove's SDK writes its messages but does not read them, and the `protobuf` package cannot be a dependency: Kinova's
client needs a version of it (3.20) that every MCAP package refuses. The reader needs one field of bytes alone. Source:
https://protobuf.dev/programming-guides/encoding
"""

_VARINT, _EIGHT_BYTES, _LENGTH_DELIMITED, _FOUR_BYTES = 0, 1, 2, 5
_FIXED_SIZES = {_EIGHT_BYTES: 8, _FOUR_BYTES: 4}


def bytes_field(message: bytes, number: int) -> bytes:
    """The length-delimited field `number` of `message`, empty where it is absent.

    Raises ValueError where `message` is not well formed.
    """
    at = 0
    while at < len(message):
        tag, at = _varint(message, at)
        kind = tag & 7
        if kind == _VARINT:
            _, at = _varint(message, at)
            continue
        length, at = _varint(message, at) if kind == _LENGTH_DELIMITED else (_FIXED_SIZES.get(kind), at)
        if length is None or at + length > len(message):
            raise ValueError("a protobuf message is malformed")
        if tag >> 3 == number and kind == _LENGTH_DELIMITED:
            return message[at : at + length]
        at += length
    return b""


def _varint(message: bytes, at: int) -> tuple[int, int]:
    """The varint that starts at `at`, seven bits a byte, and the offset after it."""
    value = shift = 0
    while at < len(message):
        byte = message[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if byte < 0x80:
            return value, at
    raise ValueError("a protobuf message ends in the middle of a number")
