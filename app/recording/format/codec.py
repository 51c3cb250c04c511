"""Messages as JSON: bytes, values and schemas, all three derived from the dataclasses.

JSON has neither typed arrays nor non-finite numbers, hence two conventions:

- An array whose shape is fixed by its annotation (a pose, an intrinsic matrix) is nested lists of numbers; Foxglove
  can plot a flat list. Any other is `{"dtype", "shape", "data"}` with base64 of its little-endian bytes: exact, and
  40 times cheaper than lists (docs/recording-format.md has the measurement). Booleans are packed eight to a byte, the
  first in its highest bit; their `dtype` is "bits".
- A non-finite number is the string "nan", "inf" or "-inf".
"""

import dataclasses
import functools
import math
import types
from collections.abc import Mapping
from typing import Any, Final, TypeVar, cast, get_args, get_origin, get_type_hints

import msgspec
import numpy as np
from jaxtyping import AbstractArray

from app.core.messages import Message
from app.recording.format.json_schema_subset import in_dialect

MessageT = TypeVar("MessageT", bound=Message)

_BITS: Final = "bits"


def encode(message: Message, kind: type[Message]) -> bytes:
    """The fields that `kind` has, taken from `message`, as JSON."""
    return msgspec.json.encode(_plain(message, kind))


def decode(data: bytes, kind: type[MessageT]) -> MessageT:
    """The message of type `kind` in `data`; its arrays are read-only.

    Raises ValueError or KeyError where `data` is not such a message (msgspec's errors are ValueErrors).
    """
    return rebuild(msgspec.json.decode(data), kind)


def rebuild(plain: Any, kind: type[MessageT]) -> MessageT:
    """The message of type `kind` that JSON holds as `plain`. Raises as `decode`."""
    return cast(MessageT, _rebuilt(plain, kind))


def schema(kind: type[Message]) -> dict[str, Any]:
    """The JSON schema of `encode(_, kind)`, as Foxglove's parser takes it."""
    (whole,), components = msgspec.json.schema_components([kind], schema_hook=_array_schema)
    return in_dialect(whole, components)


def _plain(value: Any, kind: Any) -> Any:
    """JSON representation of `value`, which is annotated as `kind`."""
    match value:
        case np.generic():
            return _plain(value.item(), kind)
        case float():
            return value if math.isfinite(value) else str(value)
        case list() | tuple():
            return [_plain(item, _item(kind)) for item in cast(list[Any], value)]
        case Mapping():
            return {key: _plain(item, _item(kind)) for key, item in cast(Mapping[str, Any], value).items()}
        case _ if dataclasses.is_dataclass(value):
            return {name: _plain(getattr(value, name), of) for name, of in _fields(kind).items()}
        case _ if hasattr(value, "__array__"):
            array = np.asarray(value)
            return _plain(array.tolist(), Any) if _is_fixed(kind) else _pack(array)
        case _:
            return value


def _rebuilt(plain: Any, kind: Any) -> Any:
    """Inverse of `_plain`: the value annotated as `kind`."""
    origin = get_origin(kind)
    if dataclasses.is_dataclass(kind):
        given = {name: of for name, of in _fields(kind).items() if name in plain or name not in _optional(kind)}
        return cast(type, kind)(**{name: _rebuilt(plain[name], of) for name, of in given.items()})
    if _is_array(kind):
        return _list(plain, kind) if _is_fixed(kind) else _unpack(plain, kind)
    if origin is tuple:
        return tuple(_rebuilt(item, _item(kind)) for item in plain)
    if isinstance(origin, type) and issubclass(origin, Mapping):
        return types.MappingProxyType({key: _rebuilt(item, _item(kind)) for key, item in plain.items()})
    return msgspec.convert(plain, kind, strict=False)


@functools.cache
def _fields(kind: Any) -> dict[str, Any]:
    """The annotation of each field of a dataclass."""
    hints = get_type_hints(kind)
    return {field.name: hints[field.name] for field in dataclasses.fields(kind)}


@functools.cache
def _optional(kind: Any) -> frozenset[str]:
    """Fields that older files may lack."""
    return frozenset(
        field.name
        for field in dataclasses.fields(kind)
        if field.default is not dataclasses.MISSING or field.default_factory is not dataclasses.MISSING
    )


def _item(kind: Any) -> Any:
    """The annotation of the elements of a tuple or mapping annotated as `kind`."""
    arguments = [argument for argument in get_args(kind) if argument is not Ellipsis]
    return arguments[-1] if arguments else Any


def _is_array(kind: Any) -> bool:
    return isinstance(kind, type) and issubclass(kind, AbstractArray)


def _is_fixed(kind: Any) -> bool:
    """True for an array annotation whose axes are all numbers."""
    return _is_array(kind) and all(axis.isdigit() for axis in kind.dim_str.split())


def _dtype(kind: Any) -> np.dtype[Any]:
    return _little(kind.dtypes[0])


def _little(name: str) -> np.dtype[Any]:
    """The type `name`, little-endian; from its string, so that it equals the native type where that is the same."""
    return np.dtype(np.dtype(name).newbyteorder("<").str)


def _pack(array: np.ndarray) -> dict[str, Any]:
    if array.dtype == np.bool_:
        return {"dtype": _BITS, "shape": list(array.shape), "data": np.packbits(array).tobytes()}
    little = np.ascontiguousarray(array, dtype=_little(array.dtype.name))
    return {"dtype": array.dtype.name, "shape": list(array.shape), "data": little.tobytes()}


def _unpack(plain: Any, kind: Any) -> np.ndarray:
    data = msgspec.convert(plain["data"], bytes)
    if plain["dtype"] == _BITS:
        bits = np.unpackbits(np.frombuffer(data, np.uint8), count=math.prod(plain["shape"]))
        return _frozen(bits.view(np.bool_).reshape(plain["shape"]))
    array = np.frombuffer(data, _little(plain["dtype"])).reshape(plain["shape"])
    return array.astype(_dtype(kind), copy=False)


def _list(plain: Any, kind: Any) -> np.ndarray:
    # NumPy reads "nan" and "inf" from strings too, but only where the type is given.
    return _frozen(np.array(plain, dtype=object).astype(_dtype(kind)))


def _frozen(array: np.ndarray) -> np.ndarray:
    array.flags.writeable = False
    return array


def _array_schema(kind: Any) -> dict[str, Any]:
    """The JSON schema of an array, for msgspec, which does not know jaxtyping's annotations."""
    if not _is_array(kind):
        raise NotImplementedError(kind)
    if not _is_fixed(kind):
        return {
            "type": "object",
            "properties": {
                "dtype": {"type": "string"},
                "shape": {"type": "array", "items": {"type": "integer"}},
                "data": {"type": "string", "contentEncoding": "base64"},
            },
            "required": ["dtype", "shape", "data"],
        }
    lists: dict[str, Any] = {"type": "number"}
    for axis in reversed(kind.dim_str.split()):
        lists = {"type": "array", "items": lists, "minItems": int(axis), "maxItems": int(axis)}
    return lists
