"""A recording without our reader: the MCAP package, the JSON package and the schemas in the file are enough."""

import base64
import json
import time
from collections import defaultdict
from pathlib import Path
from typing import Any

import cv2
import jsonschema
import numpy as np
from mcap.reader import make_reader
from mcap.records import Channel, Schema
from mcap.records import Message as Written

from app.core.messages import (
    Decision,
    Episode,
    Executed,
    Frame,
    Goal,
    Message,
    Model,
    Outcome,
    Particles,
    Proposal,
    Transition,
)
from app.recording.format.protobuf import bytes_field
from tests.recording.samples import Maker, Recording, record

Line = tuple[Schema, Channel, Written]

FIELDS = ("properties", "patternProperties")
PARTS = ("items", "additionalProperties", "anyOf", "prefixItems")


def lines(path: Path) -> list[Line]:
    """All that is in a file, by the MCAP package alone."""
    with path.open("rb") as stream:
        found = list(make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False))
    return [(schema, channel, message) for schema, channel, message in found if schema is not None]


def metadata(path: Path) -> dict[str, str]:
    with path.open("rb") as stream:
        (record,) = make_reader(stream).iter_metadata()
    return dict(record.metadata)


def test_images_clouds_poses_and_lines_are_in_foxgloves_own_schemas(recording: Recording) -> None:
    kinds = defaultdict[str, set[str]](set)
    for schema, channel, _ in lines(recording.path):
        if not channel.topic.startswith("/dipac/"):
            assert (schema.encoding, channel.message_encoding) == ("protobuf", "protobuf")
            topic = channel.topic if not channel.topic.startswith("/camera/") else channel.topic.split("/")[-1]
            kinds[topic].add(schema.name)
    assert kinds == {
        "color": {"foxglove.CompressedImage"},
        "depth": {"foxglove.RawImage"},
        "calibration": {"foxglove.CameraCalibration"},
        "/tf": {"foxglove.FrameTransforms"},
        "/tool/pose": {"foxglove.PoseInFrame"},
        "/object/particles": {"foxglove.PointCloud"},
        "/object/surface": {"foxglove.PointCloud"},
        "/object/predicted": {"foxglove.PointCloud"},
        "/goal": {"foxglove.PointCloud"},
        "/plan/predicted": {"foxglove.PointCloud"},
        "/plan/branches": {"foxglove.SceneUpdate"},
        "/executed/path": {"foxglove.SceneUpdate"},
        "/log": {"foxglove.Log"},
    }


def test_each_json_message_obeys_the_schema_in_the_file(recording: Recording) -> None:
    checked = 0
    for schema, channel, message in lines(recording.path):
        if channel.topic.startswith("/dipac/"):
            assert (schema.encoding, channel.message_encoding) == ("jsonschema", "json")
            description = json.loads(schema.data)
            assert description["type"] == "object"
            obeys(json.loads(message.data), description)
            checked += 1
    assert checked == len(recording.messages)


def obeys(value: Any, schema: dict[str, Any]) -> None:
    """Raises jsonschema.ValidationError where a JSON value is not what a schema says, or has a field too many."""
    jsonschema.Draft202012Validator(closed(schema)).validate(value)


def closed(schema: Any) -> Any:
    """A schema that forbids the fields which it does not name."""
    if isinstance(schema, list):
        return [closed(item) for item in schema]
    if not isinstance(schema, dict):
        return schema
    names = {key: {name: closed(of) for name, of in schema[key].items()} for key in FIELDS if key in schema}
    parts = {key: closed(schema[key]) for key in PARTS if key in schema}
    shut = {"additionalProperties": False} if schema.get("type") == "object" else {}
    return schema | shut | names | parts


def test_packed_arrays_can_be_unpacked_from_the_json_alone(make: Maker, tmp_path: Path) -> None:
    goal = make(Goal)
    path = record(tmp_path, make(Episode), [goal])
    (data,) = [message.data for _, channel, message in lines(path) if channel.topic == "/dipac/goal"]
    packed = json.loads(data)["positions"]
    raw = base64.b64decode(packed["data"])
    assert np.array_equal(np.frombuffer(raw, packed["dtype"]).reshape(packed["shape"]), goal.positions)


def test_depth_is_lossless_and_colour_is_jpeg(make: Maker, tmp_path: Path) -> None:
    frame = make(Frame)
    path = record(tmp_path, make(Episode), [frame])
    by_topic = {channel.topic: message.data for _, channel, message in lines(path)}
    depth = bytes_field(by_topic[f"/camera/{frame.camera.name}/depth"], 6)
    assert np.array_equal(np.frombuffer(depth, "<u2").reshape(480, 640), frame.depth)
    jpeg = bytes_field(by_topic[f"/camera/{frame.camera.name}/color"], 2)
    bgr = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    assert bgr is not None
    assert np.abs(bgr[..., ::-1].astype(int) - frame.color).max() <= 8


def test_the_file_says_at_its_start_what_ran(recording: Recording) -> None:
    episode = recording.messages[0]
    assert isinstance(episode, Episode)
    said = metadata(recording.path)
    for name in ("task", "rig", "code_version", "config"):
        assert said[name] == getattr(episode, name)
    assert (said["seed"], said["simulated"]) == (str(episode.seed), "true")
    first = recording.path.read_bytes()[:2000]
    assert episode.code_version.encode() in first


def test_log_times_are_the_times_of_writing_and_never_equal(make: Maker, tmp_path: Path) -> None:
    began_s = time.monotonic()
    notices = [make(Model) for _ in range(50)]
    path = record(tmp_path, make(Episode), notices)
    ended_s = time.monotonic()
    offset_ns = int(metadata(path)["epoch_offset_ns"])
    times = [message.log_time - offset_ns for _, _, message in lines(path)]
    assert times == sorted(set(times))
    assert began_s <= times[0] / 1e9
    assert times[-1] / 1e9 <= ended_s


def an_episode(make: Maker) -> list[Message]:
    """One push with all its causes, as the session would publish it."""
    model, goal = make(Model, cause=()), make(Goal, cause=())
    frames = [make(Frame, cause=()) for _ in range(2)]
    particles = make(Particles, cause=tuple(frame.id for frame in frames))
    approved = make.approved(
        cause=(particles.id, goal.id, model.id), particles_id=particles.id, goal_id=goal.id, model_id=model.id
    )
    proposal, decision = make.shown[-1]
    executed = make(Executed, cause=(approved.id,), approved_id=approved.id)
    transition = make(Transition, executed=executed, cause=(executed.id, particles.id))
    outcome = make(Outcome, cause=(proposal.id, executed.id, particles.id))
    return [model, goal, *frames, particles, proposal, decision, approved, executed, transition, outcome]


def test_an_executed_motion_leads_back_to_all_that_is_behind_it(make: Maker, tmp_path: Path) -> None:
    said = an_episode(make)
    path = record(tmp_path, make(Episode, cause=()), said)
    causes = dict[str, list[str]]()
    for _, channel, message in lines(path):
        if channel.topic.startswith("/dipac/"):
            content = json.loads(message.data)
            # Whatever caused a message stands before it.
            assert set(content["cause"]) <= set(causes)
            causes[content["id"]] = content["cause"]
    (executed,) = [message for message in said if isinstance(message, Executed)]
    behind, waiting = set[str](), [str(executed.id)]
    while waiting:
        message_id = waiting.pop()
        behind.add(message_id)
        waiting.extend(causes[message_id])
    kinds = {type(message) for message in said if message.id in behind}
    assert {Executed, Decision, Proposal, Model, Goal, Particles, Frame} < kinds
    assert sum(isinstance(message, Frame) and message.id in behind for message in said) == 2
