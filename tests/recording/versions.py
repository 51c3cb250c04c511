"""Recordings as older versions of the program wrote them."""

import json
from collections.abc import Iterator
from pathlib import Path

from mcap.records import Channel, DataEnd, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader

from app.recording.write.copying import write_records


def as_version_1(path: Path, goal: Path) -> Path:
    """Copy at `goal` of the recording at `path`, as version 1 wrote it: there the `doing` of Health was its `mode`."""
    goal.parent.mkdir(parents=True, exist_ok=True)
    write_records(_old(path), goal)
    return goal


def _old(path: Path) -> Iterator[McapRecord]:
    health = set[int]()
    with path.open("rb") as stream:
        for record in StreamReader(stream).records:
            match record:
                case DataEnd():
                    return
                case Metadata(name="dipac"):
                    record.metadata["schema_version"] = "1"
                case Schema(name="dipac.Health"):
                    record.data = record.data.replace(b'"doing"', b'"mode"')
                case Channel(topic="/dipac/health"):
                    health.add(record.id)
                case Message() if record.channel_id in health:
                    said = json.loads(record.data)
                    record.data = json.dumps({"mode": said.pop("doing"), **said}).encode()
                case _:
                    pass
            yield record
