"""Integrity of a file before its messages are read, and the errors that report it."""

import os
import struct
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.records import Metadata
from mcap.stream_reader import StreamReader
from zstandard import ZstdError

from app.core.errors import RecordingError, UsageError
from app.recording.format.channels import METADATA, SCHEMA_VERSION

MAGIC: Final = b"\x89MCAP0\r\n"
"""The first and the last bytes of every whole MCAP file (https://mcap.dev/spec)."""

FIRST_RECORDS: Final = 8
"""Number of records within which a recording's metadata record lies."""

DAMAGE: Final = (
    McapError,
    ArithmeticError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,
    TypeError,
    ValueError,
    ZstdError,
    struct.error,
)
"""Errors of the MCAP, LZ4 and Zstandard packages on invalid bytes, and of the disk on unreadable ones.

LZ4 raises RuntimeError; a seek to before the start of a file is an OSError.
"""


def require_file(path: Path) -> None:
    """Raises UsageError where there is no such file, naming those that exist."""
    if path.is_dir():
        raise UsageError(f"{path} is a folder; name its recordings: {path}/*.mcap")
    if not path.is_file():
        raise UsageError.unknown("recording", str(path), map(str, path.parent.glob("*.mcap")))


def inspect(path: Path) -> dict[str, str]:
    """The metadata of a recording that this version can read.

    Raises UsageError where there is no such file, RecordingError where it is not readable, not a recording, cut off or
    of a newer kind.
    """
    with reading(path):
        require_file(path)
        if not starts_as_mcap(path):
            raise RecordingError(f"{path} is not an MCAP file; recordings end in .mcap and `dipac run` makes them.")
        if not ends_as_mcap(path):
            raise RecordingError(
                f"{path} is cut off, or still being written; `dipac recover {path}` makes a whole file of what is "
                "there."
            )
        metadata = _metadata(path)
        if metadata is None and _begins_as_recording(path):
            raise RecordingError(f"{path} has no index; `dipac recover {path}` makes a whole file of it.")
    if metadata is None:
        raise RecordingError(
            f"{path} is an MCAP file of another program; only recordings of dipac can be read. `dipac import` makes "
            "one of a bag of ROS 2."
        )
    version = metadata.get("schema_version", "")
    if not version.isascii() or not version.isdecimal() or int(version) < 1:
        raise RecordingError(
            f"{path} names {version!r} as its recording schema, which is no number from 1 to {SCHEMA_VERSION}; another "
            "program has changed it."
        )
    if int(version) > SCHEMA_VERSION:
        raise RecordingError(
            f"{path} has recording schema {version}, newer than the {SCHEMA_VERSION} that this version reads; update "
            "dipac."
        )
    return metadata


def version_of(metadata: Mapping[str, str]) -> int:
    """Schema version in the metadata of a recording that has been inspected."""
    return int(metadata["schema_version"])


@contextmanager
def reading(path: Path) -> Generator[None]:
    """Turn errors of the system into RecordingError: no permission, the file has gone, or a bad disk."""
    try:
        yield
    except OSError as error:
        raise RecordingError(
            f"Cannot read {path} ({error.strerror}); make sure that it is there, that you may read it and "
            "that its disk is sound."
        ) from error


def damage_error(path: Path, error: BaseException) -> RecordingError:
    """The error to raise where reading `path` failed with `error`."""
    return RecordingError(
        f"{path} is damaged ({error or type(error).__name__}); `dipac recover {path}` makes a whole file of what is "
        "intact."
    )


def damage_of(path: Path) -> str:
    """The reason why some byte of the file is invalid; empty where all checksums hold. Reads all of it."""
    with path.open("rb") as stream:
        try:
            # Without the index, and the checksums of chunks and of the data section with it.
            for _ in StreamReader(stream, validate_crcs=True).records:
                pass  # One at a time: all of them may be more than fits into memory.
        except DAMAGE as error:
            return str(error) or type(error).__name__
    return ""


def starts_as_mcap(path: Path) -> bool:
    """True where the file begins with MCAP's magic bytes."""
    with path.open("rb") as stream:
        return stream.read(len(MAGIC)) == MAGIC


def ends_as_mcap(path: Path) -> bool:
    """True where the file ends with MCAP's magic bytes, other than those it begins with."""
    with path.open("rb") as stream:
        size = stream.seek(0, os.SEEK_END)  # Size of the open file: another may take its place in the meantime.
        stream.seek(max(0, size - len(MAGIC)))
        return size > 2 * len(MAGIC) and stream.read() == MAGIC


def _begins_as_recording(path: Path) -> bool:
    """True where one of the first records of a file without an index is a recording's metadata."""
    with path.open("rb") as stream:
        try:
            records = StreamReader(stream, emit_chunks=True, record_size_limit=path.stat().st_size).records
            return any(
                isinstance(record, Metadata) and record.name == METADATA
                for _, record in zip(range(FIRST_RECORDS), records, strict=False)
            )
        except DAMAGE:
            return False


def _metadata(path: Path) -> dict[str, str] | None:
    with path.open("rb") as stream:
        try:
            records = make_reader(stream).iter_metadata()
            return next((dict(record.metadata) for record in records if record.name == METADATA), None)
        except DAMAGE as error:
            raise damage_error(path, error) from error
