"""JSON schemas in the subset of the language that Foxglove's parser accepts.

The open one (`packages/mcap-support/src/parseJsonSchema.ts` in foxglove/studio and in Lichtblick) reads `properties`
alone, and a single field that it does not understand costs the whole channel. It knows no references, no unions, no
arrays of arrays, no `enum` without a type, and no object without `properties`. Fields beyond it are described in
`patternProperties`, which it skips and validators read: it shows such a field, and offers no path into it.
"""

import math
from collections.abc import Mapping
from typing import Any, Final, cast

Described = dict[str, Any]

_SCALARS: Final = frozenset({"boolean", "string", "number", "integer"})
_TYPES: Final[Mapping[type, str]] = {str: "string", bool: "boolean", int: "integer"}


def in_dialect(described: Described, components: Mapping[str, Described]) -> Described:
    """The schema `described`, whose references name `components`, in the accepted subset; it allows the same values.

    Non-finite defaults become strings, as they are in messages. Raises AssertionError where a component contains
    itself.
    """
    return _finite(_resolve_references(described, components, within=()))


def _resolve_references(
    described: Described, components: Mapping[str, Described], within: tuple[str, ...]
) -> Described:
    """`described` without references, and with objects and enumerations as the parser needs them, recursively."""

    def inner(part: Any) -> Any:
        return _resolve_references(cast(Described, part), components, within) if isinstance(part, dict) else part

    match described:
        case {"$ref": str(reference), **beside}:
            name = reference.rpartition("/")[2]
            assert name not in within, f"{name} holds itself, and its schema would have no end; hold its id instead"
            return _resolve_references(components[name] | beside, components, (*within, name))
        case {"prefixItems": [first, *rest], **others} if all(item == first for item in rest):
            return inner(others | {"items": first})
        case {"enum": [*values]}:
            kinds = {_TYPES.get(type(value)) for value in values}
            return described | ({"type": kinds.pop()} if len(kinds) == 1 and None not in kinds else {})
        case _:
            one = {key: inner(described[key]) for key in ("items", "additionalProperties") if key in described}
            many = {key: list(map(inner, described[key])) for key in ("anyOf", "prefixItems") if key in described}
            fields = {name: inner(field) for name, field in described.get("properties", {}).items()}
            return described | one | many | (_fields(fields) if described.get("type") == "object" else {})


def _fields(fields: Mapping[str, Described]) -> Described:
    """The fields of an object: those that the parser accepts, and the others where it does not look."""
    taken = {name: field for name, field in fields.items() if _is_taken(field)}
    others = {f"^{name}$": field for name, field in fields.items() if name not in taken}
    return {"properties": taken} | ({"patternProperties": others} if others else {})


def _is_taken(field: Described) -> bool:
    match field:
        case {"type": "string", "contentEncoding": encoding}:
            return encoding == "base64"
        case {"type": "array", "items": {"contentEncoding": _}}:
            return False
        case {"type": "array", "items": {"type": str(kind)}} | {"type": str(kind)}:
            return kind in _SCALARS or kind == "object"
        case _:
            return False


def _finite(described: Any) -> Any:
    match described:
        case dict():
            return {key: _finite(item) for key, item in cast(Described, described).items()}
        case list():
            return [_finite(item) for item in cast(list[Any], described)]
        case float() if not math.isfinite(described):
            return str(described)
        case _:
            return described
