"""Messages for Foxglove: read by Google's reader of protobuf with the schemas that Foxglove ships, and whole."""

import json
import re
from pathlib import Path
from typing import Any

import foxglove.messages
import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.records import Schema

from app.core.messages import Message
from app.recording.format.channels import KINDS
from bench.foxglove_layout import layout
from tests.recording.samples import Recording

# No dependency of the program: Kinova's client needs an old version of it (app/recording/format/protobuf.py).
pytest.importorskip("google.protobuf", reason="The package `protobuf` is missing; `make develop` installs it.")
from google.protobuf import descriptor_pb2, descriptor_pool, message_factory

LAYOUT = Path(__file__).parents[2] / "docs" / "foxglove-layout.json"
SIZES = {"16UC1": 2}
TYPES = {7: 4}
"""Bytes of a number of a packed field: FLOAT32."""


def kind_of(schema: Schema) -> Any:
    """Class of the messages of a schema, made from the descriptors in it."""
    files = descriptor_pb2.FileDescriptorSet.FromString(schema.data)
    pool = descriptor_pool.DescriptorPool()
    for file in files.file:
        pool.Add(file)
    return message_factory.GetMessageClass(pool.FindMessageTypeByName(schema.name))


@pytest.fixture(scope="module")
def views(recording: Recording) -> list[tuple[str, Schema, int, Any]]:
    """Topic, schema, log time and parsed message of everything that Foxglove draws."""
    kinds, found = dict[int, Any](), list[tuple[str, Schema, int, Any]]()
    with recording.path.open("rb") as stream:
        for schema, channel, written in make_reader(stream).iter_messages(log_time_order=False):
            if schema is not None and channel.message_encoding == "protobuf":
                kind = kinds.setdefault(schema.id, None) or kind_of(schema)
                kinds[schema.id] = kind
                found.append((channel.topic, schema, written.log_time, kind.FromString(written.data)))
    return found


def test_schemas_are_those_that_foxglove_ships(views: list[tuple[str, Schema, int, Any]]) -> None:
    for schema in {schema.name: schema for _, schema, _, _ in views}.values():
        shipped = getattr(foxglove.messages, schema.name.removeprefix("foxglove.")).get_schema()
        assert (schema.name, schema.encoding, schema.data) == (shipped.name, shipped.encoding, shipped.data)


def test_every_message_is_of_its_schema_without_a_field_too_many(views: list[tuple[str, Schema, int, Any]]) -> None:
    for topic, _, _, message in views:
        size = message.ByteSize()
        message.DiscardUnknownFields()
        assert message.ByteSize() == size, topic


def test_frames_are_those_of_the_transforms(views: list[tuple[str, Schema, int, Any]]) -> None:
    transforms = [each for topic, _, _, message in views if topic == "/tf" for each in message.transforms]
    frames = {"world"} | {each.child_frame_id for each in transforms}
    assert {each.parent_frame_id for each in transforms} == {"world"}
    for topic, _, _, message in views:
        named = [message, *getattr(message, "entities", [])]
        assert {each.frame_id for each in named if hasattr(each, "frame_id")} <= frames, topic
    for each in transforms:
        turn = each.rotation
        assert np.linalg.norm([turn.x, turn.y, turn.z, turn.w]) == pytest.approx(1)


def test_images_and_clouds_are_as_large_as_they_say(views: list[tuple[str, Schema, int, Any]]) -> None:
    checked = set[str]()
    for _, schema, _, message in views:
        checked.add(schema.name)
        match schema.name:
            case "foxglove.RawImage":
                assert message.step == SIZES[message.encoding] * message.width
                assert len(message.data) == message.step * message.height
            case "foxglove.PointCloud":
                assert [field.name for field in message.fields] == ["x", "y", "z"]
                assert message.point_stride == sum(TYPES[field.type] for field in message.fields)
                assert len(message.data) % message.point_stride == 0
            case "foxglove.CameraCalibration":
                assert (len(message.K), len(message.R), len(message.P)) == (9, 9, 12)
            case _:
                pass
    assert {"foxglove.RawImage", "foxglove.PointCloud", "foxglove.CameraCalibration"} <= checked


def test_every_message_is_dated_as_the_one_that_it_is_written_with(
    recording: Recording, views: list[tuple[str, Schema, int, Any]]
) -> None:
    with recording.path.open("rb") as stream:
        (metadata,) = make_reader(stream).iter_metadata()
    offset_ns = int(metadata.metadata["epoch_offset_ns"])
    dated = {round(message.time_s * 1e9) + offset_ns for message in recording.messages}
    for topic, _, _, message in views:
        for part in getattr(message, "transforms", []) or getattr(message, "entities", []) or [message]:
            stamp_ns = part.timestamp.ToNanoseconds()
            assert any(abs(stamp_ns - each) < 1000 for each in dated), topic


def test_the_layout_in_the_documentation_is_the_one_that_is_made() -> None:
    assert json.loads(LAYOUT.read_text()) == json.loads(layout().to_json())


def test_the_layout_shows_what_recordings_hold(views: list[tuple[str, Schema, int, Any]]) -> None:
    topics = {re.sub(r"^/camera/[^/]+/", "/camera/*/", topic) for topic, _, _, _ in views}
    text = LAYOUT.read_text()
    shown = set(re.findall(r'"(/[^"]*)"', text))
    for word in shown:
        topic, _, field = word.partition(".")
        if topic in KINDS:
            assert field.partition("[")[0] in fields(KINDS[topic]), word
        else:
            assert re.sub(r"^/camera/[^/]+/", "/camera/*/", topic) in topics, word
    assert topics - {"/tf"} <= {re.sub(r"^/camera/[^/]+/", "/camera/*/", word) for word in shown}


def fields(kind: type[Message]) -> set[str]:
    return set(kind.__dataclass_fields__)
