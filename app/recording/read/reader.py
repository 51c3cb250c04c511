"""Messages of a recording, in the order in which they were written."""

import itertools
from collections.abc import Collection, Iterator
from pathlib import Path
from typing import Any, Final, NamedTuple

import cv2
import mcap.records
import numpy as np
from mcap.reader import McapReader, make_reader

from app.core.errors import RecordingError
from app.core.geometry.camera import CameraModel
from app.core.messages import Episode, Frame, Message, MessageId, Particles, Transition
from app.recording.format.channels import KINDS, SURFACE_TOPIC, TOPICS, color_topic, depth_topic, record_of
from app.recording.format.integrity import DAMAGE, damage_error, inspect, reading, version_of
from app.recording.format.migrate import decode_of
from app.recording.format.protobuf import bytes_field
from app.recording.format.records import FrameRecord, ParticlesRecord

# The numbers of the `data` fields in Foxglove's .proto files.
_COMPRESSED_IMAGE_DATA: Final = 2
_RAW_IMAGE_DATA: Final = 6
_POINT_CLOUD_DATA: Final = 6

_FIRST_FRAMES: Final = 20
"""Number of frames within which every camera appears."""


def read_messages(path: Path, kinds: Collection[type[Message]] = tuple(TOPICS)) -> Iterator[Message]:
    """Every message of the given kinds, in the order in which they were written, migrated to this version.

    Arrays are read-only. A frame's colours went through JPEG; everything else is exact. An `Approved` comes back as its
    `ApprovalRecord`.

    Raises UsageError where there is no such file, and RecordingError where it is not readable, not a recording of this
    program, cut off, or damaged.
    """
    return _messages(path, kinds, version_of(inspect(path)))


def read_transitions(path: Path) -> list[Transition]:
    """The transitions of an episode. Raises as `read_messages`."""
    return [message for message in read_messages(path, [Transition]) if isinstance(message, Transition)]


def read_episode(path: Path) -> Episode:
    """The start of an episode. Raises as `read_messages`."""
    for message in read_messages(path, [Episode]):
        if isinstance(message, Episode):
            return message
    raise RecordingError(f"{path} names no episode; it was cut off before its first message.")


def read_cameras(path: Path) -> list[CameraModel]:
    """The cameras of a recording's first frames; no image is read. Raises as `read_messages`."""
    version = version_of(inspect(path))
    cameras = dict[str, CameraModel]()
    with reading(path), path.open("rb") as stream:
        try:
            reader = make_reader(stream, validate_crcs=True)
            written = reader.iter_messages([TOPICS[Frame]], log_time_order=False)
            for _, _, message in itertools.islice(written, _FIRST_FRAMES):
                camera = decode_of(version, message.data, TOPICS[Frame], FrameRecord).camera
                cameras[camera.name] = camera
        except DAMAGE as error:
            raise damage_error(path, error) from error
    return list(cameras.values())


def read_frame_times(path: Path) -> dict[str, list[float]]:
    """Moments of exposure [s] by camera, in order; no image is read. Raises as `read_messages`."""
    version = version_of(inspect(path))
    times = dict[str, list[float]]()
    with reading(path), path.open("rb") as stream:
        try:
            for _, _, message in make_reader(stream, validate_crcs=True).iter_messages([TOPICS[Frame]]):
                record = decode_of(version, message.data, TOPICS[Frame], FrameRecord)
                times.setdefault(record.camera.name, []).append(record.time_s)
        except DAMAGE as error:
            raise damage_error(path, error) from error
    return {name: sorted(of_one) for name, of_one in times.items()}


class Picture(NamedTuple):
    """A pair of images as stored; `time_s` is the moment of exposure.

    `jpeg`: the colours; `depth`: little-endian 16-bit numbers in steps of the camera's unit, 0 without a reading.
    """

    camera: CameraModel
    time_s: float
    jpeg: bytes
    depth: bytes


def read_pictures(path: Path) -> Iterator[Picture]:
    """Every pair of images of a recording, in the order in which they were written; nothing is decoded.

    Raises as `read_messages`.
    """
    version = version_of(inspect(path))
    parts: dict[str, _Part] = {}
    with reading(path), path.open("rb") as stream:
        try:
            reader = make_reader(stream, validate_crcs=True)
            topics = [topic for topic in _topics(reader, [Frame]) if not topic.endswith("/calibration")]
            for _, channel, written in reader.iter_messages(topics, log_time_order=False):
                if channel.topic != TOPICS[Frame]:
                    parts[channel.topic] = _Part(written.log_time, written.data)
                    continue
                record = decode_of(version, written.data, channel.topic, FrameRecord)
                color, depth = (parts.get(topic(record.camera.name)) for topic in (color_topic, depth_topic))
                if color and depth and color.log_time_ns == depth.log_time_ns == written.log_time:
                    yield Picture(
                        record.camera,
                        record.time_s,
                        bytes_field(color.data, _COMPRESSED_IMAGE_DATA),
                        bytes_field(depth.data, _RAW_IMAGE_DATA),
                    )
        except DAMAGE as error:
            raise damage_error(path, error) from error


class _Part(NamedTuple):
    """The newest Foxglove message of a channel: it belongs to the record with the same log time."""

    log_time_ns: int
    data: bytes


def _messages(path: Path, kinds: Collection[type[Message]], version: int) -> Iterator[Message]:
    with reading(path), path.open("rb") as stream:
        try:
            for logged in logged_messages(make_reader(stream, validate_crcs=True), kinds, version):
                yield logged.message
        except DAMAGE as error:
            raise damage_error(path, error) from error


class Logged(NamedTuple):
    """A message and its log time [ns] in the file: later than that of every one before it."""

    log_time_ns: int
    message: Message


def logged_messages(
    reader: McapReader,
    kinds: Collection[type[Message]],
    version: int,
    *,
    first_ns: int | None = None,
    last_ns: int | None = None,
) -> Iterator[Logged]:
    """The messages of the given kinds that were logged from `first_ns` to `last_ns` [ns], both included, in order.

    `version` is that of the file's schema. Only the chunks of that time are read. A message that another program wrote
    twice counts once. Raises the errors of `DAMAGE` on invalid bytes.
    """
    parts: dict[str, _Part] = {}
    ids = set[MessageId]()
    topics = _topics(reader, kinds)
    for _, channel, written in reader.iter_messages(
        topics, log_time_order=False, starting_at=first_ns, ending_at=last_ns
    ):
        kind = KINDS.get(channel.topic)
        if kind is None:
            parts[channel.topic] = _Part(written.log_time, written.data)
            continue
        record = decode_of(version, written.data, channel.topic, record_of(kind))
        message = _whole(record, written, parts)
        if message and message.id not in ids:
            ids.add(message.id)
            yield Logged(written.log_time, message)


def _topics(reader: McapReader, kinds: Collection[type[Message]]) -> list[str]:
    """The channels to read for messages of `kinds`: images and surfaces only where they are part of one."""
    summary = reader.get_summary()
    written = {channel.topic for channel in summary.channels.values()} if summary else set[str]()
    topics = {TOPICS[kind] for kind in kinds}
    if Frame in kinds:
        topics |= {topic for topic in written if topic.startswith("/camera/")}
    if Particles in kinds:
        topics |= {SURFACE_TOPIC}
    return sorted(topics & written)


def _whole(record: Message, written: mcap.records.Message, parts: dict[str, _Part]) -> Message | None:
    """The message that `record` stands for, None where its parts were lost with a chunk that could not be recovered.

    Raises ValueError where a part is invalid.
    """

    def part(topic: str, field: int) -> bytes | None:
        found = parts.get(topic)
        return bytes_field(found.data, field) if found and found.log_time_ns == written.log_time else None

    match record:
        case FrameRecord(camera=camera):
            jpeg = part(color_topic(camera.name), _COMPRESSED_IMAGE_DATA)
            depth = part(depth_topic(camera.name), _RAW_IMAGE_DATA)
            return _frame(record, jpeg, depth) if jpeg is not None and depth is not None else None
        case ParticlesRecord():
            surface = part(SURFACE_TOPIC, _POINT_CLOUD_DATA)
            return Particles(**_fields(record), surface=_cloud(surface)) if surface is not None else None
        case _:
            return record


def _frame(record: FrameRecord, jpeg: bytes, depth: bytes) -> Frame:
    color = _color(jpeg)
    return Frame(**_fields(record), color=color, depth=np.frombuffer(depth, "<u2").reshape(color.shape[:2]))


def _cloud(data: bytes) -> np.ndarray:
    """Points `(M, 3)` [m]."""
    return np.frombuffer(data, "<f4").reshape(-1, 3)


def _fields(record: Message) -> dict[str, Any]:
    return dict(vars(record))


def _color(jpeg: bytes) -> np.ndarray:
    """An RGB image `(height, width, 3)`. Raises ValueError where `jpeg` is not one."""
    image = cv2.imdecode(np.frombuffer(jpeg, np.uint8), cv2.IMREAD_COLOR)
    if image is None:
        raise ValueError("a colour image cannot be decoded")
    return cv2.cvtColor(image, cv2.COLOR_BGR2RGB)
