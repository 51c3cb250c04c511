"""Foxglove's open parser of JSON schemas: its rules in our words, to try our schemas on.

Read in foxglove/studio (9abf665) and Lichtblick (9554e1e), `packages/mcap-support/src/parseJsonSchema.ts`, which
`parseChannel.ts` calls for each JSON channel after `JSON.parse`. Where the two differ, this is the stricter one:
Lichtblick takes an object without `properties`, Foxglove throws.
"""

import base64
import json
from typing import Any

SCALARS = ("boolean", "string", "number", "integer")


class RefusedError(Exception):
    """Raised where the parser would throw: no message of the channel is shown."""


def parsed(text: bytes) -> dict[str, str]:
    """The kind of each path that the parser finds in a schema as it is in a file; `[]` stands for any item."""
    return paths(json.loads(text, parse_constant=_no_json), "")


def paths(schema: dict[str, Any], at: str) -> dict[str, str]:
    """The kind of each path below `at`, which is an object. Raises RefusedError as the parser throws."""
    if schema.get("type") != "object":
        raise RefusedError(f"{at} is no object")
    if "properties" not in schema:
        raise RefusedError(f"{at} has no properties to walk through")
    found = dict[str, str]()
    for name, field in schema["properties"].items():
        found |= _field(field, f"{at}.{name}".lstrip("."))
    return found


def shown(value: Any, schema: dict[str, Any]) -> Any:
    """A message as it is shown: strings that the schema calls base64 have become bytes."""
    if schema["type"] == "array" and isinstance(value, list):
        return [shown(item, schema["items"]) for item in value]
    if schema["type"] == "object" and isinstance(value, dict):
        known = schema["properties"]
        return {key: shown(item, known[key]) if key in known else item for key, item in value.items()}
    return base64.b64decode(value, validate=True) if "contentEncoding" in schema else value


def _field(field: Any, at: str) -> dict[str, str]:
    described = field if isinstance(field, dict) else {}
    kind = described.get("type")
    if isinstance(described.get("oneOf"), list):
        if any(type(choice.get("const")) not in (int, float) for choice in described["oneOf"]):
            raise RefusedError(f"{at} is one of what are not numbers")
        return {at: "integer"}
    if kind == "array":
        return _items(described.get("items"), at)
    if kind == "object":
        return {at: kind} | paths(described, at)
    if kind not in SCALARS:
        raise RefusedError(f"{at} is of type {kind}")
    if kind == "string" and described.get("contentEncoding", "base64") != "base64":
        raise RefusedError(f"{at} is encoded in another way than base64")
    return {at: "bytes" if "contentEncoding" in described else kind}


def _items(items: Any, at: str) -> dict[str, str]:
    kind = items.get("type") if isinstance(items, dict) else None
    if kind == "object":
        return {at: "array"} | paths(items, f"{at}[]")
    if kind not in SCALARS:
        raise RefusedError(f"{at} is an array of type {kind}")
    if kind == "string" and "contentEncoding" in items:
        raise RefusedError(f"{at} is an array of encoded strings")
    return {at: "array", f"{at}[]": kind}


def _no_json(constant: str) -> Any:
    raise RefusedError(f"{constant} is no JSON")
