"""The intact records of a damaged recording, by its checksums, its messages' schemas and their parts."""

import io
import mmap
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import Final, final

from mcap.data_stream import ReadDataStream
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import Channel, Chunk, DataEnd, McapRecord, Message, Metadata, Schema
from mcap.stream_reader import StreamReader, breakup_chunk

from app.recording.format.channels import KINDS, METADATA, SCHEMA_VERSION, part_topics, record_of
from app.recording.format.integrity import DAMAGE
from app.recording.format.migrate import decode_of
from app.recording.library.label import LABEL

_RECORD_HEAD_BYTES: Final = 1 + 8
_CHUNK_HEAD_BYTES: Final = 8 + 8 + 8 + 4
"""Bytes of a record before its content, and of a chunk's content before the name of its compression (mcap.dev/spec)."""


def _string(text: str) -> bytes:
    """A string in a record: its length, then its characters."""
    return len(text).to_bytes(4, "little") + text.encode()


_MARKS: Final = (
    *((Opcode.CHUNK, _RECORD_HEAD_BYTES + _CHUNK_HEAD_BYTES, _string(name)) for name in ("lz4", "zstd")),
    *((Opcode.METADATA, _RECORD_HEAD_BYTES, _string(name)) for name in (METADATA, LABEL)),
)
"""Records by which reading finds its way again after a damaged spot: opcode, and bytes some way after its start."""


@final
class Salvage:
    """The intact records of the file, in order.

    Once all have been read, `lost_bytes` counts the bytes that hold no record, and `left_out` the messages, by topic,
    that cannot be decoded, lack their images or their cloud, or are there twice.
    """

    def __init__(self, path: Path) -> None:
        self.lost_bytes = 0
        self.left_out = Counter[str]()
        self._path = path
        self._version = 0
        self._topics: dict[int, str] = {}
        self._parts: dict[str, int] = {}
        self._ids = set[str]()
        self._written = set[tuple[int, int, bytes]]()
        self._metadata = list[tuple[str, dict[str, str]]]()

    def __iter__(self) -> Iterator[McapRecord]:
        for record in self._summarised():
            yield from self._sound(record)
        for record in self._scanned():
            yield from self._sound(record)

    def _summarised(self) -> Iterator[McapRecord]:
        """Records that the end of the file repeats: the chunk or spot that first had them may be lost."""
        with self._path.open("rb") as stream:
            try:
                summary = make_reader(stream).get_summary()
            except DAMAGE:
                return
            if summary is None:
                return
            for index in summary.metadata_indexes:
                # The index has a length of its own.
                stream.seek(index.offset + _RECORD_HEAD_BYTES)
                content = stream.read(min(index.length, self._path.stat().st_size))
                with suppress(*DAMAGE):
                    yield Metadata.read(ReadDataStream(io.BytesIO(content)))
        yield from summary.schemas.values()
        yield from summary.channels.values()

    def _scanned(self) -> Iterator[McapRecord]:
        """All records, from the beginning, and after a damaged spot from the next record that is recognised."""
        size = self._path.stat().st_size
        with self._path.open("rb") as stream:
            intact_end, next_start = 0, 0
            while next_start < size:
                stream.seek(next_start)
                # A garbled length would otherwise be allocated before it is found out.
                reader = StreamReader(stream, skip_magic=next_start > 0, emit_chunks=True, record_size_limit=size)
                records = iter(reader.records)
                while True:
                    try:
                        record = next(records, None)
                    except DAMAGE:
                        break
                    if record is None or isinstance(record, DataEnd):
                        return
                    yield from self._chunk_records(record, length=stream.tell() - next_start)
                    intact_end = next_start = stream.tell()
                next_start = _recognised_record(self._path, after=intact_end) or size
                self.lost_bytes += next_start - intact_end
                intact_end = next_start

    def _chunk_records(self, record: McapRecord, *, length: int) -> Iterator[McapRecord]:
        """The records in a chunk whose checksum holds; any other record as it is."""
        if not isinstance(record, Chunk):
            yield record
            return
        try:
            yield from breakup_chunk(record, validate_crc=True)
        except DAMAGE:
            self.lost_bytes += length

    def _sound(self, record: McapRecord) -> Iterator[McapRecord]:
        """The record, unless it is a message to be left out, or metadata that were there already."""
        match record:
            case Metadata(name=name, metadata=metadata):
                if (name, metadata) in self._metadata:
                    return
                self._metadata.append((name, metadata))
                if name == METADATA and metadata.get("schema_version", "").isdecimal():
                    self._version = int(metadata["schema_version"])
            case Channel(id=number, topic=topic):
                self._topics[number] = topic
            case Message():
                if not self._is_sound(record):
                    self.left_out[self._topics.get(record.channel_id, "unknown")] += 1
                    return
            case Schema() | _:
                pass
        yield record

    def _is_sound(self, message: Message) -> bool:
        topic = self._topics.get(message.channel_id)
        whole = (message.channel_id, message.log_time, message.data)
        if topic is None or whole in self._written:
            return False
        kind = KINDS.get(topic)
        if kind is None:
            # Only the parts of the newest message can be there twice.
            self._written = {each for each in self._written if each[1] == message.log_time} | {whole}
            self._parts[topic] = message.log_time
            return True
        if not 1 <= self._version <= SCHEMA_VERSION:
            return True
        try:
            record = decode_of(self._version, message.data, topic, record_of(kind))
        except DAMAGE:
            return False
        parts = part_topics(record)
        if record.id in self._ids or any(self._parts.get(part) != message.log_time for part in parts):
            return False
        self._ids.add(record.id)
        return True


def _recognised_record(path: Path, *, after: int) -> int | None:
    """Offset of the first record behind the damaged one at `after` that is recognised; None where there is none."""
    found = list[int]()
    with path.open("rb") as stream, mmap.mmap(stream.fileno(), 0, access=mmap.ACCESS_READ) as data:
        for opcode, ahead, mark in _MARKS:
            at = after + ahead
            while (at := data.find(mark, at + 1)) >= 0:
                start = at - ahead
                length = int.from_bytes(data[start + 1 : start + _RECORD_HEAD_BYTES], "little")
                if data[start] == opcode and start + _RECORD_HEAD_BYTES + length <= len(data):
                    found.append(start)
                    break
    return min(found, default=None)
