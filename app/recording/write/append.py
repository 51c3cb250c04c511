"""Append a metadata record to a complete MCAP file, as `mcap add metadata` does; the file is replaced atomically.

The data section stays as it is, byte for byte. Behind it come the new record and the summary, rewritten to include the
record: https://mcap.dev/spec, "Summary Section" and "Footer".
"""

import dataclasses
import os
import struct
import zlib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Final

from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.reader import make_reader
from mcap.records import DataEnd, Footer, McapRecord, Metadata, MetadataIndex, SummaryOffset
from mcap.summary import Summary

from app.recording.format.integrity import DAMAGE, MAGIC, damage_error
from app.recording.write.replace import replace_file

_FOOTER_BYTES: Final = 1 + 8 + 8 + 8 + 4
_DATA_END_BYTES: Final = 1 + 8 + 4


def append_metadata(path: Path, name: str, metadata: Mapping[str, str]) -> None:
    """Append the record to the complete file at `path`. An interruption leaves the old file or the new one.

    Raises RecordingError where the file is damaged or the new one cannot be written; the old one stays then.
    """
    with replace_file(path) as (old, new):
        added = Metadata(name=name, metadata=dict(metadata))
        summary, end, crc = _summary_and_end(old)
        record = _bytes([added])
        index = MetadataIndex(offset=end, length=len(record), name=name)
        with old.open("rb") as source, new.open("wb") as target:
            _copy(source.fileno(), target.fileno(), end)
            target.seek(end)
            # Zero means no checksum.
            target.write(record + _bytes([DataEnd(data_section_crc=zlib.crc32(record, crc) if crc else 0)]))
            target.write(_tail(summary, index, start=end + len(record) + _DATA_END_BYTES))


def _summary_and_end(path: Path) -> tuple[Summary, int, int]:
    """Summary, end offset of the data section (the record before the summary), and its checksum."""
    with path.open("rb") as stream:
        try:
            summary = make_reader(stream).get_summary()
            stream.seek(-(len(MAGIC) + _FOOTER_BYTES), os.SEEK_END)
            opcode, _, summary_start, _, _ = struct.unpack("<BQQQI", stream.read(_FOOTER_BYTES))
            end = summary_start - _DATA_END_BYTES
            stream.seek(end)
            kind, _, crc = struct.unpack("<BQI", stream.read(_DATA_END_BYTES))
            if summary is None or opcode != Opcode.FOOTER or kind != Opcode.DATA_END:
                raise ValueError("its summary is not where its footer says")
        except DAMAGE as error:
            raise damage_error(path, error) from error
    return summary, end, crc


def _copy(source: int, target: int, count: int) -> None:
    """Copy the first `count` bytes between file descriptors inside the kernel."""
    done = 0
    while done < count:
        copied = os.sendfile(target, source, done, count - done)
        if not copied:
            raise OSError(0, "the file became shorter meanwhile")
        done += copied


def _tail(summary: Summary, added: MetadataIndex, *, start: int) -> bytes:
    """Summary, its offsets, footer and magic, for a summary that begins at `start`."""
    statistics = summary.statistics
    counted = [dataclasses.replace(statistics, metadata_count=statistics.metadata_count + 1)] if statistics else []
    groups: dict[Opcode, Iterable[McapRecord]] = {
        Opcode.SCHEMA: summary.schemas.values(),
        Opcode.CHANNEL: summary.channels.values(),
        Opcode.STATISTICS: counted,
        Opcode.CHUNK_INDEX: summary.chunk_indexes,
        Opcode.ATTACHMENT_INDEX: summary.attachment_indexes,
        Opcode.METADATA_INDEX: [*summary.metadata_indexes, added],
    }
    body, offsets = b"", list[McapRecord]()
    for opcode, records in groups.items():
        data = _bytes(records)
        if data:
            offsets.append(SummaryOffset(group_opcode=opcode, group_start=start + len(body), group_length=len(data)))
        body += data
    told = body + _bytes(offsets)
    places = struct.pack("<BQQQ", Opcode.FOOTER, 8 + 8 + 4, start, start + len(body))
    footer = Footer(
        summary_start=start, summary_offset_start=start + len(body), summary_crc=zlib.crc32(places, zlib.crc32(told))
    )
    return told + _bytes([footer]) + MAGIC


def _bytes(records: Iterable[McapRecord]) -> bytes:
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    return builder.end()
