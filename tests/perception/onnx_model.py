"""Tiny ONNX files, written by hand: a 1 x 1 convolution over the colours, which is all that a test needs."""

import struct
from collections.abc import Sequence
from pathlib import Path

_FLOAT, _DOUBLE = 1, 11


def convolution(
    path: Path,
    weights: Sequence[Sequence[float]],
    biases: Sequence[float],
    *,
    size: tuple[int, int] | None = None,
    channels: int = 3,
    kind: int = _FLOAT,
) -> Path:
    """A network whose output `k` is `weights[k]` times the colour plus `biases[k]`; `size` None leaves it open."""
    spatial = size or ("height", "width")
    graph = b"".join(
        [
            _part(1, _node()),
            _text(2, "graph"),
            _part(5, _numbers("weight", (len(biases), channels, 1, 1), [w for row in weights for w in row])),
            _part(5, _numbers("bias", (len(biases),), biases)),
            _part(11, _tensor("image", (1, channels, *spatial), kind)),
            _part(12, _tensor("scores", (1, len(biases), *spatial), kind)),
        ]
    )
    path.write_bytes(_number(1, 8) + _part(7, graph) + _part(8, _text(1, "") + _number(2, 13)))
    return path


def _node() -> bytes:
    names = b"".join(_text(1, name) for name in ("image", "weight", "bias"))
    kernel = _text(1, "kernel_shape") + _number(8, 1) + _number(8, 1) + _number(20, 7)
    return names + _text(2, "scores") + _text(3, "conv") + _text(4, "Conv") + _part(5, kernel)


def _tensor(name: str, shape: Sequence[int | str], kind: int) -> bytes:
    dims = b"".join(_part(1, _number(1, axis) if isinstance(axis, int) else _text(2, axis)) for axis in shape)
    return _text(1, name) + _part(2, _part(1, _number(1, kind) + _part(2, dims)))


def _numbers(name: str, shape: Sequence[int], values: Sequence[float]) -> bytes:
    dims = b"".join(_number(1, axis) for axis in shape)
    return dims + _number(2, _FLOAT) + _text(8, name) + _part(9, struct.pack(f"<{len(values)}f", *values))


def _number(field: int, value: int) -> bytes:
    return _varint(field << 3) + _varint(value)


def _text(field: int, value: str) -> bytes:
    return _part(field, value.encode())


def _part(field: int, value: bytes) -> bytes:
    return _varint(field << 3 | 2) + _varint(len(value)) + value


def _varint(value: int) -> bytes:
    out = bytearray()
    while value > 0x7F:
        out.append(value & 0x7F | 0x80)
        value >>= 7
    out.append(value)
    return bytes(out)
