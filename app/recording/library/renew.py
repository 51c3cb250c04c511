"""Upgrade of an old recording to the newest version of the format."""

import json
from collections.abc import Iterator
from pathlib import Path

import msgspec
from mcap.reader import make_reader
from mcap.records import Channel, DataEnd, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from app.core.errors import RecordingError
from app.recording.format import digests
from app.recording.format.channels import KINDS, METADATA, SCHEMA_VERSION, record_of
from app.recording.format.codec import schema
from app.recording.format.integrity import DAMAGE, damage_error, inspect, version_of
from app.recording.format.migrate import changed_since, migrate_message
from app.recording.write.copying import write_records
from app.recording.write.replace import replace_file


def renew(path: Path) -> bool:
    """Rewrite the recording at `path` in the newest version; False where it has that already and stays as it is.

    Its labels, images, ids and log times stay; its SHA-256 is renewed where it was correct. An interruption leaves the
    old file or the new one. Raises as `integrity.inspect`, and RecordingError where it is damaged, being written or
    cannot be replaced.
    """
    version = version_of(inspect(path))
    if version == SCHEMA_VERSION:
        return False
    with digests.authorised_change(path), replace_file(path) as (old, new):
        try:
            counted, written = _count(old), write_records(_records(old, version), new)
        except OSError:
            raise
        except DAMAGE as error:
            raise damage_error(path, error) from error
        if counted != written:
            raise RecordingError(f"{path} has {written} messages, and its summary counts {counted}; it stays as it is.")
    return True


def _records(path: Path, version: int) -> Iterator[McapRecord]:
    """All records of the file, with the schemas and messages of the newest version."""
    changed, topics = changed_since(version), dict[int, str]()
    with path.open("rb") as stream:
        for record in StreamReader(stream, validate_crcs=True).records:
            match record:
                case DataEnd():
                    return
                case Metadata(name=name, metadata=metadata) if name == METADATA:
                    yield Metadata(name=name, metadata=metadata | {"schema_version": str(SCHEMA_VERSION)})
                case Channel(id=channel_id, topic=topic) if topic in changed:
                    topics[channel_id] = topic
                    yield from _describe(record)
                case Message(channel_id=channel_id) if channel_id in topics:
                    plain = migrate_message(msgspec.json.decode(record.data), topics[channel_id], version)
                    record.data = msgspec.json.encode(plain)
                    yield record
                case _:
                    yield record


def _describe(channel: Channel) -> Iterator[McapRecord]:
    """The channel with its own schema of the newest version."""
    kind = KINDS[channel.topic]
    data = json.dumps(schema(record_of(kind)), allow_nan=False).encode()
    # No schema of the file has such a number.
    channel.schema_id = -channel.id
    yield Schema(id=channel.schema_id, name=f"dipac.{kind.__name__}", encoding="jsonschema", data=data)
    yield channel


def _count(path: Path) -> int:
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
        if summary is None or summary.statistics is None:
            raise ValueError("it has no summary")
        return summary.statistics.message_count
