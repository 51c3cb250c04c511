"""Frames of the Kortex protocol: four words of bit fields, a payload, and their delimiting on a stream.

Source: `Frame.proto` (pitt-rnel/kortex, protos) for the fields and their bits; magic and length as the TCP transport of
kortex_api 2.6.0 writes them (docs/kinova.md). Over UDP a datagram is one frame, without magic and length.
"""

import struct
from dataclasses import dataclass
from enum import IntEnum
from typing import Annotated, final

from app.rig.kinova.api.errors import WireError
from app.rig.kinova.api.protobuf import Field, decode, encode

MAGIC = b"\x07xEtRoK\x07"
VERSION = 1
LONGEST_DATAGRAM = 65507
LONGEST_FRAME = 1 << 22
"""Longest frame on a stream [byte]: 4 MiB. The header's length field holds 16 MiB; no call here comes near either."""
_PREFIX = len(MAGIC) + 4


class FrameKind(IntEnum):
    """Kind of a frame."""

    REQUEST = 1
    RESPONSE = 3
    NOTIFICATION = 5
    PING = 7
    PONG = 8


@final
@dataclass(frozen=True, kw_only=True)
class _Header:
    frame_info: Annotated[int, Field(1, "fixed32")] = 0
    message_info: Annotated[int, Field(2, "fixed32")] = 0
    service_info: Annotated[int, Field(3, "fixed32")] = 0
    payload_info: Annotated[int, Field(4, "fixed32")] = 0


@final
@dataclass(frozen=True, kw_only=True)
class _Envelope:
    header: Annotated[_Header | None, Field(1, "message")] = None
    payload: Annotated[bytes, Field(2, "bytes")] = b""


@final
@dataclass(frozen=True, kw_only=True)
class KortexFrame:
    """One message. `message` counts requests and is repeated by answers; a notification has its subscription's handle.

    `error` and `sub_error` are 0 for success; else the payload has details.
    """

    kind: int
    service: int = 0
    function: int = 0
    session: int = 0
    message: int = 0
    device: int = 0
    error: int = 0
    sub_error: int = 0
    payload: bytes = b""

    def encode(self) -> bytes:
        """The frame as a datagram. Raises WireError where a number does not fit its bits."""
        header = _Header(
            frame_info=_pack(
                (VERSION, 4, "version"),
                (self.kind, 4, "kind"),
                (self.device, 8, "device"),
                (self.error, 4, "error"),
                (self.sub_error, 12, "sub_error"),
            ),
            message_info=_pack((self.session, 16, "session"), (self.message, 16, "message")),
            service_info=_pack((VERSION, 4, "version"), (self.service, 12, "service"), (self.function, 16, "function")),
            payload_info=_pack((0, 8, "reserved"), (len(self.payload), 24, "payload length")),
        )
        return encode(_Envelope(header=header, payload=self.payload))

    def encode_for_stream(self) -> bytes:
        """The frame as sent on a stream. Raises WireError where it is too long."""
        data = self.encode()
        if len(data) > LONGEST_FRAME:
            raise WireError(f"A frame of {len(data)} bytes is longer than {LONGEST_FRAME}; send less at once.")
        return MAGIC + struct.pack(">I", len(data)) + data


def decode_frame(data: bytes) -> KortexFrame:
    """The frame in `data`, a datagram or a part from `Splitter`. Raises WireError where it is invalid."""
    envelope = decode(_Envelope, data)
    if (header := envelope.header) is None:
        raise WireError("A frame has no header.")
    version, kind, device, error, sub_error = _unpack(header.frame_info, 4, 4, 8, 4, 12)
    if version != VERSION:
        raise WireError(f"A frame is of version {version} of the protocol, this program speaks {VERSION}.")
    session, message = _unpack(header.message_info, 16, 16)
    _, service, function = _unpack(header.service_info, 4, 12, 16)
    return KortexFrame(
        kind=kind,
        service=service,
        function=function,
        session=session,
        message=message,
        device=device,
        error=error,
        sub_error=sub_error,
        payload=envelope.payload,
    )


@final
class Splitter:
    """Splits a stream of bytes into frames."""

    def __init__(self) -> None:
        self._left = bytearray()

    def feed(self, data: bytes) -> list[bytes]:
        """Complete frames so far, for `decode_frame`. Raises WireError where the stream is not of this protocol."""
        self._left += data
        found = list[bytes]()
        while self._check_magic() and len(self._left) >= _PREFIX:
            (length,) = struct.unpack_from(">I", self._left, len(MAGIC))
            if length > LONGEST_FRAME:
                raise WireError(f"A frame claims {length} bytes; more than {LONGEST_FRAME} are not taken.")
            if len(self._left) < _PREFIX + length:
                break
            found.append(bytes(self._left[_PREFIX : _PREFIX + length]))
            del self._left[: _PREFIX + length]
        return found

    def _check_magic(self) -> bool:
        """Always true, but for an empty stream; raises WireError where the bytes so far do not begin a frame."""
        start = self._left[: len(MAGIC)]
        if not MAGIC.startswith(start):
            raise WireError(f"A frame begins with {start.hex(' ')}, not with {MAGIC.hex(' ')}; is this a Kinova arm?")
        return len(start) > 0


def _pack(*parts: tuple[int, int, str]) -> int:
    """A word of (value, bits, name), the highest first."""
    word = 0
    for value, bits, name in parts:
        if not 0 <= value < 1 << bits:
            raise WireError(f"The {name} {value} of a frame does not fit into {bits} bits.")
        word = word << bits | value
    return word


def _unpack(word: int, *widths: int) -> list[int]:
    """The parts of a word of 32 bits, the highest first."""
    parts, left = list[int](), 32
    for bits in widths:
        left -= bits
        parts.append(word >> left & (1 << bits) - 1)
    return parts
