"""Interface of a network from its ONNX file: names, types and shapes of inputs and outputs, without running it.

The file is a protobuf message; the numbers of its fields are those of onnx.proto3 (ONNX 1.0 to 1.19, unchanged).
"""

from collections.abc import Iterator
from typing import Final, NamedTuple, TypeAlias

_GRAPH: Final = 7
_INITIALIZER, _INPUT, _OUTPUT = 5, 11, 12
_NAME, _TYPE, _TENSOR, _ELEMENT, _SHAPE, _DIM, _VALUE = 1, 2, 1, 1, 2, 1, 1
_INITIALIZER_NAME: Final = 8
_FLOAT: Final = 1
_VARINT, _FIXED64, _BYTES, _FIXED32 = 0, 1, 2, 5

Field: TypeAlias = tuple[int, int | bytes]
"""Number and content of a protobuf field."""


class Tensor(NamedTuple):
    """An input or output; 0 stands for an open size."""

    name: str
    float32: bool
    shape: tuple[int, ...]

    def __str__(self) -> str:
        sizes = ", ".join(str(size) if size else "?" for size in self.shape)
        return f"{self.name!r} ({sizes}){'' if self.float32 else ' of another type than 32-bit floats'}"


def tensors(data: bytes) -> tuple[list[Tensor], list[Tensor]]:
    """Inputs and outputs of the network in `data`. Raises ValueError where it is invalid."""
    graph = next((value for number, value in _fields(data) if number == _GRAPH and isinstance(value, bytes)), None)
    if graph is None:
        raise ValueError("it holds no graph")
    # Files before ONNX 1.3 list the network's weights among its inputs, too.
    own = {_text_field(part, _INITIALIZER_NAME) for part in _parts(graph, _INITIALIZER)}
    inputs = [_tensor(part) for part in _parts(graph, _INPUT)]
    return [each for each in inputs if each.name not in own], [_tensor(part) for part in _parts(graph, _OUTPUT)]


def _tensor(data: bytes) -> Tensor:
    of = next((t for kind in _parts(data, _TYPE) for t in _parts(kind, _TENSOR)), b"")
    element = next((value for number, value in _fields(of) if number == _ELEMENT), 0)
    sizes = (dim for shape in _parts(of, _SHAPE) for dim in _parts(shape, _DIM))
    return Tensor(_text_field(data, _NAME), element == _FLOAT, tuple(_size(dim) for dim in sizes))


def _size(dim: bytes) -> int:
    """Size of one axis; 0 where it has a name instead."""
    return next((value for number, value in _fields(dim) if number == _VALUE and isinstance(value, int)), 0)


def _text_field(data: bytes, field: int) -> str:
    return next((part.decode(errors="replace") for part in _parts(data, field)), "")


def _parts(data: bytes, field: int) -> list[bytes]:
    return [value for number, value in _fields(data) if number == field and isinstance(value, bytes)]


def _fields(data: bytes) -> Iterator[Field]:
    """The fields of a message, in order. Raises ValueError where it is cut off or invalid."""
    at = 0
    while at < len(data):
        key, at = _varint(data, at)
        number, wire = key >> 3, key & 7
        if wire == _VARINT:
            value, at = _varint(data, at)
            yield number, value
            continue
        if wire == _BYTES:
            size, at = _varint(data, at)
        elif wire in (_FIXED64, _FIXED32):
            size = 8 if wire == _FIXED64 else 4
        else:
            raise ValueError(f"a field of kind {wire} at byte {at}")
        if at + size > len(data):
            raise ValueError(f"it ends within a field at byte {at}")
        yield number, data[at : at + size]
        at += size


def _varint(data: bytes, at: int) -> tuple[int, int]:
    """A varint, 7 bits a byte, and the offset after it."""
    value, shift = 0, 0
    while at < len(data) and shift < 70:
        byte = data[at]
        value |= (byte & 0x7F) << shift
        at, shift = at + 1, shift + 7
        if not byte & 0x80:
            return value, at
    raise ValueError(f"it ends within a number at byte {at}")
