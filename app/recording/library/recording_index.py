"""Index of a folder of recordings: the state of each file, read from its first and last bytes alone."""

import json
import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Final, Literal, TypeAlias, cast, final

from mcap.reader import make_reader
from mcap.records import Chunk, Metadata
from mcap.stream_reader import StreamReader

from app.core.errors import DipacError, UsageError
from app.core.messages import Fault, Outcome, Transition
from app.recording.format.channels import METADATA, topic_of
from app.recording.format.integrity import DAMAGE, FIRST_RECORDS, damage_error, ends_as_mcap, inspect, starts_as_mcap
from app.recording.format.lock import is_being_written
from app.recording.library.label import LABEL, Label

Condition: TypeAlias = Literal["whole", "recording", "cut off", "unreadable"]
"""State of a file. `recording`: being written now; `unreadable`: damaged, another program's, or of a newer kind."""

_NS: Final = 1e9


@final
@dataclass(frozen=True, kw_only=True)
class Entry:
    """One file. Fields that could not be read are empty; `why` then gives the reason.

    `began`: its start, in UTC; `duration_s` from its first message to its last; `counts`: messages by topic.
    """

    path: Path
    size_bytes: int
    condition: Condition
    why: str = ""
    metadata: Mapping[str, str] = field(default_factory=dict[str, str])
    began: datetime | None = None
    duration_s: float = float("nan")
    counts: Mapping[str, int] = field(default_factory=dict[str, int])
    label: Label | None = None

    @property
    def task(self) -> str:
        """Name of the recorded task."""
        return self.metadata.get("task", "")

    @property
    def pushes(self) -> int:
        """Number of actions whose object was observed before and after."""
        return max(self.counts.get(topic_of(kind), 0) for kind in (Outcome, Transition))

    @property
    def faults(self) -> int:
        """Number of recorded faults."""
        return self.counts.get(topic_of(Fault), 0)

    @property
    def demonstration(self) -> bool:
        """True for a demonstration, by a scripted expert or by hand."""
        return bool(self._config.get("expert") or self._config.get("demonstration"))

    @property
    def session(self) -> str:
        """Name of the session's file that a demonstration or clip is a part of; empty for a recording of its own."""
        return str(self._config.get("session", ""))

    @property
    def _config(self) -> Mapping[str, Any]:
        try:
            config: Any = json.loads(self.metadata.get("config", "{}"))
        except ValueError:
            return {}
        return cast(Mapping[str, Any], config) if isinstance(config, dict) else {}

    @property
    def state(self) -> str:
        """A sentence on its condition, for one that is not whole."""
        if self.condition == "unreadable":
            return self.why
        if self.condition == "recording":
            return f"{self.path} is being written; wait for its end."
        return f"{self.path} is {self.condition}; {self.why}."

    @property
    def said(self) -> str:
        """Verdict of its label, empty where there is none."""
        return self.label.said if self.label and self.label.said != "unlabelled" else ""

    def row(self) -> dict[str, Any]:
        """The entry as plain values, for JSON."""
        return {
            "path": str(self.path),
            "condition": self.condition,
            "why": self.why,
            "task": self.task,
            "began": self.began.isoformat(timespec="seconds") if self.began else None,
            "duration_s": None if math.isnan(self.duration_s) else round(self.duration_s, 3),
            "size_bytes": self.size_bytes,
            "pushes": self.pushes,
            "faults": self.faults,
            "demonstration": self.demonstration,
            "session": self.session,
            "label": self.said,
            "note": self.label.note if self.label else "",
            "schema_version": self.metadata.get("schema_version", ""),
        }


def shelf(places: Iterable[Path]) -> Sequence[Entry]:
    """The named recordings, and those in the named folders, oldest first.

    Raises UsageError where there is no such file or folder.
    """
    paths = dict[Path, Path]()
    for place in places:
        if not place.exists():
            raise UsageError.unknown("recording", str(place), map(str, place.parent.glob("*.mcap")))
        found = sorted(place.rglob("*.mcap")) if place.is_dir() else [place]
        # Links within a folder lead to files that are listed anyway, or belong elsewhere.
        paths |= {path.resolve(): path for path in found if path == place or (path.is_file() and not path.is_symlink())}
    return sorted((entry(path) for path in paths.values()), key=_age)


def counted_once(paths: Sequence[Path]) -> Sequence[Path]:
    """`paths` without the parts of sessions that are among them: a push in both must count once."""
    sessions = {path.resolve() for path in paths}
    return [
        path for path in paths if not (name := entry(path).session) or path.resolve().with_name(name) not in sessions
    ]


def entry(path: Path) -> Entry:
    """State of the file; one that has gone or is not accessible is unreadable."""
    size_bytes = 0
    try:
        size_bytes = path.stat().st_size
        if is_being_written(path):
            return _unfinished_entry(path, size_bytes, "recording", "")
        if not ends_as_mcap(path) and starts_as_mcap(path):
            return _unfinished_entry(path, size_bytes, "cut off", f"`dipac recordings recover {path}` makes it whole")
        return _whole(path, size_bytes, inspect(path))
    except OSError as error:
        why = f"Cannot read {path} ({error.strerror}); make sure that you may."
        return Entry(path=path, size_bytes=size_bytes, condition="unreadable", why=why)
    except DipacError as error:
        return Entry(path=path, size_bytes=size_bytes, condition="unreadable", why=str(error))


def _whole(path: Path, size_bytes: int, metadata: Mapping[str, str]) -> Entry:
    with path.open("rb") as stream:
        try:
            reader = make_reader(stream)
            summary, records = reader.get_summary(), list(reader.iter_metadata())
            statistics = summary.statistics if summary else None
            if summary is None or statistics is None:
                raise ValueError("it has no summary")
        except DAMAGE as error:
            raise damage_error(path, error) from error
    labels = [Label.read(record.metadata) for record in records if record.name == LABEL]
    first_ns, last_ns = statistics.message_start_time, statistics.message_end_time
    return Entry(
        path=path,
        size_bytes=size_bytes,
        condition="whole",
        metadata=metadata,
        began=datetime.fromtimestamp(first_ns / _NS, UTC) if statistics.message_count else None,
        duration_s=(last_ns - first_ns) / _NS,
        counts={
            channel.topic: statistics.channel_message_counts.get(channel.id, 0) for channel in summary.channels.values()
        },
        label=labels[-1] if labels else None,
    )


def _unfinished_entry(path: Path, size_bytes: int, condition: Condition, why: str) -> Entry:
    """Entry of a file without an end, from its first records."""
    metadata, began = dict[str, str](), datetime.fromtimestamp(path.stat().st_mtime, UTC)
    with path.open("rb") as stream:
        try:
            # A garbled length would otherwise be allocated before it is found out.
            records = StreamReader(stream, emit_chunks=True, record_size_limit=max(size_bytes, 1)).records
            for _, record in zip(range(FIRST_RECORDS), records, strict=False):
                if isinstance(record, Metadata) and record.name == METADATA:
                    metadata = dict(record.metadata)
                if isinstance(record, Chunk):
                    began = datetime.fromtimestamp(record.message_start_time / _NS, UTC)
                    break
        except DAMAGE as error:
            why = why or f"{error or type(error).__name__}"
    return Entry(path=path, size_bytes=size_bytes, condition=condition, why=why, metadata=metadata, began=began)


def _age(entry: Entry) -> tuple[datetime, str]:
    return entry.began or datetime.min.replace(tzinfo=UTC), str(entry.path)
