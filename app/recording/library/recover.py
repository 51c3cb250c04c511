"""Recovery of a recording that a crash cut off or a disk damaged."""

import itertools
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import final

from mcap.reader import make_reader
from mcap.records import Chunk, DataEnd, McapRecord
from mcap.stream_reader import StreamReader, breakup_chunk
from mcap.summary import Summary

from app.core.errors import RecordingError
from app.recording.format import digests
from app.recording.format.integrity import DAMAGE, ends_as_mcap, reading, require_file, starts_as_mcap
from app.recording.format.lock import is_being_written
from app.recording.library.label import LABEL, labels
from app.recording.write.append import append_metadata
from app.recording.write.copying import write_records


@final
@dataclass(frozen=True, kw_only=True)
class Recovered:
    """Result of a recovery.

    `path` is the new file, or the old one where it was sound (`was_whole`); `messages` counts its messages on all
    channels; `lost_bytes` of the old file were invalid.
    """

    path: Path
    messages: int
    lost_bytes: int
    was_whole: bool


def recover(path: Path) -> Recovered:
    """Write all that is intact in the recording at `path` to a new, indexed file `NAME.recovered.mcap` beside it.

    That is everything before the damage, and after a damaged chunk everything from the next one on. The original is
    left as it is; a complete file is not copied.

    Raises UsageError where there is no such file, RecordingError where it is not readable, not an MCAP file, nothing in
    it is intact or the new file cannot be written.
    """
    with reading(path):
        require_file(path)
        if not starts_as_mcap(path):
            raise RecordingError(f"{path} is not an MCAP file; there is nothing to recover.")
        if is_being_written(path):
            raise RecordingError(f"{path} is being written; end the program that records it first.")
    goal = path.with_name(f"{path.stem}.recovered.mcap")
    draft = goal.with_suffix(".draft")
    try:
        salvage, summary = _Salvage(path), _summary(path)
        messages = write_records(itertools.chain(_declarations(summary), salvage), draft)
        if messages == 0:
            raise RecordingError(f"{path} was cut off before its first message; there is nothing to recover.")
        if salvage.lost_bytes == 0 and ends_as_mcap(path) and _is_whole(path, messages):
            return Recovered(path=path, messages=messages, lost_bytes=0, was_whole=True)
        for label in labels(goal) if goal.is_file() else ():  # Labels of an earlier recovery.
            append_metadata(draft, LABEL, label.written())
        draft.replace(goal)
        digests.note(goal)
    except OSError as error:
        raise RecordingError(
            f"Cannot recover {path} to {goal.name} ({error.strerror}); "
            "copy it to a folder that has room and may be written to."
        ) from None
    finally:
        draft.unlink(missing_ok=True)
    return Recovered(path=goal, messages=messages, lost_bytes=salvage.lost_bytes, was_whole=False)


@final
class _Salvage:
    """The intact records of a file, in order; `lost_bytes` counts the rest once all have been read."""

    def __init__(self, path: Path) -> None:
        self.lost_bytes = 0
        self._path = path

    def __iter__(self) -> Iterator[McapRecord]:
        size = self._path.stat().st_size
        with self._path.open("rb") as stream:
            # A garbled length would otherwise be allocated before it is found out.
            records = iter(StreamReader(stream, emit_chunks=True, record_size_limit=size).records)
            intact_end = 0
            while True:
                try:
                    record = next(records)
                except DAMAGE:
                    self.lost_bytes += size - intact_end
                    return
                if isinstance(record, DataEnd):
                    return
                yield from self._chunk_records(record, length=stream.tell() - intact_end)
                intact_end = stream.tell()

    def _chunk_records(self, record: McapRecord, *, length: int) -> Iterator[McapRecord]:
        """The records in a chunk whose checksum holds; any other record as it is."""
        if not isinstance(record, Chunk):
            yield record
            return
        try:
            yield from breakup_chunk(record, validate_crc=True)
        except DAMAGE:
            self.lost_bytes += length


def _summary(path: Path) -> Summary | None:
    """Summary section of the file, None where it cannot be read."""
    with path.open("rb") as stream:
        try:
            return make_reader(stream).get_summary()
        except DAMAGE:
            return None


def _is_whole(path: Path, messages: int) -> bool:
    """True where the index leads to as many messages as a scan finds."""
    with path.open("rb") as stream:
        try:
            reader = make_reader(stream, validate_crcs=True)
            return any(True for _ in reader.iter_metadata()) and messages == sum(1 for _ in reader.iter_messages())
        except DAMAGE:
            return False


def _declarations(summary: Summary | None) -> Iterator[McapRecord]:
    """Schemas and channels of the summary: the chunk that first declared one may be lost."""
    if summary is not None:
        yield from summary.schemas.values()
        yield from summary.channels.values()
