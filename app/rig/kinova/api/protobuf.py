"""Protocol Buffers as bytes. A message is a frozen dataclass whose annotations carry the fields' numbers and kinds.

The encoding is that of proto3 (https://protobuf.dev/programming-guides/encoding): defaults are left out, numbers that
repeat are packed, fields of unknown number or of another wire type than expected are skipped.
"""

import dataclasses
import math
import struct
import types
from dataclasses import dataclass
from functools import cache
from typing import Any, Literal, TypeAlias, TypeVar, Union, cast, final, get_args, get_origin, get_type_hints

from app.rig.kinova.api.errors import WireError

Kind: TypeAlias = Literal["uint32", "bool", "fixed32", "float", "string", "bytes", "message"]
"""Kind of a field. An enumeration is a `uint32` here, so that values of newer firmware survive."""

_Message = TypeVar("_Message")
_VARINT, _EIGHT_BYTES, _BYTES, _FOUR_BYTES = 0, 1, 2, 5
_WIRE_TYPES: dict[Kind, int] = {
    "uint32": _VARINT,
    "bool": _VARINT,
    "fixed32": _FOUR_BYTES,
    "float": _FOUR_BYTES,
    "string": _BYTES,
    "bytes": _BYTES,
    "message": _BYTES,
}
_LONGEST_VARINT, _WORD, _MAX_FIELD = 10, 0xFFFFFFFF, (1 << 29) - 1


@final
@dataclass(frozen=True)
class Field:
    """Number and kind of a message field, given in its `Annotated` type."""

    number: int
    kind: Kind


@final
@dataclass(frozen=True, kw_only=True)
class _Slot:
    """A field with its derived properties; `message` is the class of a message field."""

    name: str
    number: int
    kind: Kind
    default: object
    repeated: bool
    message: type[Any]


def encode(message: object) -> bytes:
    """`message` as bytes. Raises WireError where a number does not fit its field or is not finite."""
    written = bytearray()
    for slot in _slots(type(message)).values():
        value = getattr(message, slot.name)
        if value != slot.default:
            written += _field(slot, value)
    return bytes(written)


def decode(cls: type[_Message], data: bytes) -> _Message:
    """The message of class `cls` in `data`. Raises WireError, and nothing else, where it is invalid."""
    slots, found, position = _slots(cls), dict[str, Any](), 0
    while position < len(data):
        tag, position = _varint(data, position)
        number, wire_type = tag >> 3, tag & 7
        if not 0 < number <= _MAX_FIELD:
            raise WireError(f"A message has a field of number {number}, which no message may have.")
        raw, position = _raw(data, position, wire_type)
        if (slot := slots.get(number)) is None:
            continue
        if slot.repeated:
            found[slot.name] = (*found.get(slot.name, ()), *_repeat(slot, wire_type, raw))
        elif wire_type == _WIRE_TYPES[slot.kind]:
            found[slot.name] = _value(slot, raw)
    return cls(**found)


@cache
def _slots(cls: type[Any]) -> dict[int, _Slot]:
    """The fields of a message by number."""
    hints, slots = get_type_hints(cls, include_extras=True), dict[int, _Slot]()
    for each in dataclasses.fields(cls):
        inner, field = get_args(hints[each.name])[:2]
        assert isinstance(field, Field), f"{cls}.{each.name} has no number"
        repeated = get_origin(inner) is tuple
        if get_origin(inner) in (tuple, Union, types.UnionType):
            inner = get_args(inner)[0]
        slots[field.number] = _Slot(
            name=each.name,
            number=field.number,
            kind=field.kind,
            default=each.default,
            repeated=repeated,
            message=cast(type[Any], inner),
        )
    return slots


def _field(slot: _Slot, value: Any) -> bytes:
    """A field with its tag, or tags where messages or texts repeat."""
    if not slot.repeated:
        return _tag(slot.number, _WIRE_TYPES[slot.kind], _one(slot, value))
    if _WIRE_TYPES[slot.kind] == _BYTES:
        return b"".join(_tag(slot.number, _BYTES, _one(slot, each)) for each in value)
    return _tag(slot.number, _BYTES, b"".join(_one(slot, each) for each in value))


def _tag(number: int, wire_type: int, content: bytes) -> bytes:
    length = _as_varint(len(content)) if wire_type == _BYTES else b""
    return _as_varint(number << 3 | wire_type) + length + content


def _one(slot: _Slot, value: Any) -> bytes:
    """A value without tag and length."""
    match slot.kind:
        case "message":
            return encode(value)
        case "string":
            return value.encode()
        case "bytes":
            return value
        case "float":
            return _as_float(slot.name, value)
        case "bool":
            return _as_varint(int(value))
        case "uint32" | "fixed32":
            if not 0 <= value <= _WORD:
                raise WireError(f"{slot.name} = {value} does not fit into 32 bits without a sign.")
            return _as_varint(value) if slot.kind == "uint32" else struct.pack("<I", value)


def _as_float(name: str, value: float) -> bytes:
    if not math.isfinite(value):
        raise WireError(f"{name} = {value} is not finite; it must not be sent to an arm.")
    try:
        return struct.pack("<f", value)
    except OverflowError:
        raise WireError(f"{name} = {value:g} does not fit into a number of single precision.") from None


def _as_varint(value: int) -> bytes:
    written = bytearray()
    while value > 0x7F:
        written.append(value & 0x7F | 0x80)
        value >>= 7
    written.append(value)
    return bytes(written)


def _varint(data: bytes, position: int) -> tuple[int, int]:
    """A varint that begins at `position`, and the position after it."""
    value = 0
    for index, byte in enumerate(data[position : position + _LONGEST_VARINT]):
        value |= (byte & 0x7F) << 7 * index
        if byte < 0x80:
            return value, position + index + 1
    raise WireError("A message ends within a number, or has one of more than ten bytes.")


def _raw(data: bytes, position: int, wire_type: int) -> tuple[int | bytes, int]:
    """Undecoded content of a field, and the position after it."""
    if wire_type == _VARINT:
        return _varint(data, position)
    if wire_type == _BYTES:
        length, position = _varint(data, position)
    elif wire_type in (_EIGHT_BYTES, _FOUR_BYTES):
        length = 8 if wire_type == _EIGHT_BYTES else 4
    else:
        raise WireError(f"A message has a field of wire type {wire_type}, which this protocol does not use.")
    if position + length > len(data):
        raise WireError(f"A message ends {position + length - len(data)} bytes before its field does.")
    return data[position : position + length], position + length


def _repeat(slot: _Slot, wire_type: int, raw: int | bytes) -> tuple[Any, ...]:
    """One or, packed, several values of a repeated field; none for another wire type."""
    expected = _WIRE_TYPES[slot.kind]
    if wire_type == expected:
        return (_value(slot, raw),)
    if wire_type != _BYTES or not isinstance(raw, bytes):
        return ()
    values, position = list[Any](), 0
    while position < len(raw):
        each, position = _raw(raw, position, expected)
        values.append(_value(slot, each))
    return tuple(values)


def _value(slot: _Slot, raw: Any) -> Any:
    """Decoded value of a field; `raw` has the wire type of its kind."""
    match slot.kind:
        case "message":
            return decode(slot.message, raw)
        case "string":
            try:
                return raw.decode()
            except UnicodeDecodeError:
                raise WireError(f"{slot.name} is not text in UTF-8.") from None
        case "bytes":
            return raw
        case "float":
            return float(struct.unpack("<f", raw)[0])
        case "fixed32":
            return int(struct.unpack("<I", raw)[0])
        case "bool":
            return raw != 0
        case "uint32":
            return raw & _WORD
