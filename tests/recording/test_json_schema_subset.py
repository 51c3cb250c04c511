"""Foxglove's parser takes the schema of every channel, and what it cannot be told is still in the schema."""

import json
from dataclasses import dataclass
from typing import Any, Literal

import jsonschema
import msgspec
import pytest

from app.core.messages import Frame, Goal, Message
from app.recording.format.channels import record_of
from app.recording.format.codec import encode, schema
from app.recording.format.json_schema_subset import in_dialect
from tests.recording.inspector import RefusedError, parsed, paths, shown
from tests.recording.samples import Maker, Recording, all_kinds
from tests.recording.test_foxglove import lines, obeys


@dataclass
class Part:
    """Something that stands twice in the whole."""

    size: float = float("inf")


@dataclass
class Whole:
    """All of the language that our messages could come to use."""

    part: Part
    parts: tuple[Part, ...]
    by_name: dict[str, Part]
    perhaps: float | None
    either: int | str
    word: Literal["a", "b"]
    number: Literal[1, 2]
    word_or_number: Literal["a", 1]
    matrix: tuple[tuple[float, ...], ...]
    pair: tuple[float, float]
    mixed: tuple[int, str, Part]
    raw: bytes
    raws: tuple[bytes, ...]
    anything: Any
    type: str
    properties: dict[str, float]
    enum: tuple[str, ...]


@dataclass
class Endless:
    """A list that is linked."""

    following: "Endless | None" = None


def described(kind: type) -> dict[str, Any]:
    (whole,), components = msgspec.json.schema_components([kind])
    return in_dialect(whole, components)


@pytest.mark.parametrize("kind", all_kinds(), ids=lambda kind: kind.__name__)
def test_the_parser_takes_every_kind_of_message(kind: type[Message], make: Maker) -> None:
    description = schema(record_of(kind))
    found = parsed(json.dumps(description).encode())
    assert (found["id"], found["time_s"], found["cause[]"]) == ("string", "number", "string")
    plain = json.loads(encode(make(kind), record_of(kind)))
    assert shown(plain, description).keys() == plain.keys()


def test_the_parser_takes_every_channel_of_a_file(recording: Recording) -> None:
    found = {
        channel.topic.removeprefix("/dipac/"): parsed(schema.data)
        for schema, channel, _ in lines(recording.path)
        if schema.encoding == "jsonschema"
    }
    assert len(found) == len(all_kinds())
    # Paths that docs/recording-format.md offers for a plot.
    assert found["arm_state"]["velocity[]"] == found["outcome"]["chamfer_after_m2"] == "number"
    assert found["proposal"]["branches[].origin"] == found["mode"]["mode"] == "string"
    assert found["health"]["frame_age_s"] == "object"


def test_packed_arrays_are_shown_as_bytes(make: Maker) -> None:
    goal = make(Goal)
    positions = shown(json.loads(encode(goal, Goal)), schema(Goal))["positions"]
    assert positions["data"] == goal.positions.tobytes()


def test_whatever_a_message_could_hold_is_taken_and_is_described() -> None:
    found = parsed(json.dumps(described(Whole), allow_nan=False).encode())
    untold = {"perhaps", "either", "word_or_number", "matrix", "mixed", "raws", "anything"}
    assert {path for path in found if "." not in path and "[]" not in path} == set(Whole.__annotations__) - untold
    assert (found["word"], found["number"], found["raw"], found["pair[]"]) == ("string", "integer", "bytes", "number")
    assert found["part.size"] == found["parts[].size"] == "number"
    jsonschema.Draft202012Validator.check_schema(described(Whole))


GOOD = {
    "part": {"size": 1.0},
    "parts": [{"size": 1.0}, {}],
    "by_name": {"x": {"size": 1.0}},
    "perhaps": None,
    "either": "a",
    "word": "b",
    "number": 2,
    "word_or_number": "a",
    "matrix": [[1.0], []],
    "pair": [1.0, 2.0],
    "mixed": [1, "a", {"size": 1.0}],
    "raw": "AA==",
    "raws": ["AA=="],
    "anything": [],
    "type": "object",
    "properties": {"x": 1.0},
    "enum": ["a"],
}


def test_a_validator_takes_what_is_right() -> None:
    obeys(GOOD, described(Whole))


@pytest.mark.parametrize(
    ("name", "wrong"),
    [
        ("part", {"size": "big"}),
        ("parts", [{"size": "big"}]),
        ("by_name", {"x": {"size": "big"}}),
        ("perhaps", "no"),
        ("either", 1.5),
        ("word", "c"),
        ("number", 3),
        ("word_or_number", 2),
        ("matrix", [1.0]),
        ("pair", [1.0]),
        ("mixed", ["a", 1, {}]),
        ("raws", [1]),
        ("properties", {"x": "y"}),
        ("enum", [1]),
        ("unheard_of", 1),
    ],
)
def test_a_validator_refuses_what_is_wrong(name: str, wrong: Any) -> None:
    with pytest.raises(jsonschema.ValidationError):
        obeys(GOOD | {name: wrong}, described(Whole))


def test_a_matrix_of_another_size_does_not_obey(make: Maker) -> None:
    plain = json.loads(encode(make(Frame), record_of(Frame)))
    obeys(plain, schema(record_of(Frame)))
    plain["camera"]["K"].pop()
    with pytest.raises(jsonschema.ValidationError):
        obeys(plain, schema(record_of(Frame)))


def test_a_type_that_holds_itself_is_told_of() -> None:
    with pytest.raises(AssertionError, match="Endless holds itself"):
        described(Endless)


@pytest.mark.parametrize(
    "field",
    [
        {"$ref": "#/$defs/Part"},
        {"type": "object", "additionalProperties": {"type": "number"}},
        {"enum": ["a", "b"]},
        {"const": "a"},
        {"anyOf": [{"type": "number"}, {"type": "null"}]},
        {"type": ["number", "null"]},
        {"type": "null"},
        {"oneOf": [{"const": "a"}]},
        {"type": "array"},
        {"type": "array", "items": False, "prefixItems": [{"type": "number"}]},
        {"type": "array", "items": {"type": "array", "items": {"type": "number"}}},
        {"type": "array", "items": {"type": "string", "contentEncoding": "base64"}},
        {"type": "string", "contentEncoding": "base16"},
        {"type": "array", "items": {"type": "object"}},
        True,
        {},
    ],
)
def test_the_parser_would_refuse(field: Any) -> None:
    with pytest.raises(RefusedError):
        paths({"type": "object", "properties": {"field": field}}, "")


def test_the_parser_would_refuse_what_is_no_json_or_no_object() -> None:
    for text in (b'{"type": "object", "properties": {"a": {"type": "number", "default": NaN}}}', b'{"type": "array"}'):
        with pytest.raises(RefusedError):
            parsed(text)
