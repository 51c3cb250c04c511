"""Integrity check of a recording: every byte, every message, every cause, and its checksum."""

from collections import Counter
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Final, final

from mcap.reader import make_reader

from app.core.messages import Episode, Message, MessageId
from app.recording.format import digests
from app.recording.format.channels import (
    KINDS,
    SCHEMA_VERSION,
    part_topics,
    record_of,
    topic_of,
)
from app.recording.format.integrity import DAMAGE, damage_of, version_of
from app.recording.format.migrate import decode_of
from app.recording.library.recording_index import Entry, entry

_OURS: Final = "/dipac/"
_CAUSE: Final = "name a cause that is not in the recording before them"
_INCOMPLETE: Final = "lack their images or their cloud"
_TWICE: Final = "have an id that another has"


@final
@dataclass(frozen=True, kw_only=True)
class RecordingIssue:
    """A deviation in a recording. `grave`: part of the recording is lost or cannot be trusted."""

    grave: bool
    text: str


def check(path: Path) -> Sequence[RecordingIssue]:
    """Findings on the recording at `path`, empty for a sound one. Reads all of it."""
    found = entry(path)
    if found.condition != "whole":
        return [RecordingIssue(grave=found.condition != "recording", text=found.state)]
    if why := damage_of(path):
        return [_damage(path, why)]
    try:
        return [*_version(found), *_checksum(path), *_contents(found)]
    except DAMAGE as error:
        return [_damage(path, str(error) or type(error).__name__)]


def _damage(path: Path, why: str) -> RecordingIssue:
    return RecordingIssue(grave=True, text=f"damaged: {why}; `dipac recordings recover {path}` saves what is intact")


def _version(found: Entry) -> Iterator[RecordingIssue]:
    version = version_of(found.metadata)
    if version < SCHEMA_VERSION:
        next_step = f"`dipac recordings migrate {found.path}` rewrites it"
        yield RecordingIssue(grave=False, text=f"of version {version}, read as if of {SCHEMA_VERSION}; {next_step}")


def _checksum(path: Path) -> Iterator[RecordingIssue]:
    noted = digests.stored_digest(path)
    if noted is None:
        yield RecordingIssue(grave=False, text=f"no checksum of it in {digests.SUMS}")
    elif noted != digests.digest(path):
        yield RecordingIssue(grave=True, text=f"its SHA-256 is not the one in {digests.SUMS}: somebody changed it")


@dataclass(kw_only=True)
class _Seen:
    """State of the pass over the messages before the current one."""

    ids: set[MessageId] = field(default_factory=set[MessageId])
    parts: dict[str, int] = field(default_factory=dict[str, int])
    last_ns: int = 0
    last_of_ours_ns: int = -1
    count: int = 0
    faults: Counter[str] = field(default_factory=Counter[str])


def _contents(found: Entry) -> Iterator[RecordingIssue]:
    """One pass over all messages, in the order in which they were written."""
    seen, version, counted = _Seen(), version_of(found.metadata), sum(found.counts.values())
    with found.path.open("rb") as stream:
        for _, channel, written in make_reader(stream, validate_crcs=True).iter_messages(log_time_order=False):
            seen.count += 1
            if written.log_time < seen.last_ns:
                seen.faults["go back in time"] += 1
            seen.last_ns = written.log_time
            kind = KINDS.get(channel.topic)
            if kind is not None:
                record = decode_of(version, written.data, channel.topic, record_of(kind))
                _look(record, written.log_time, seen)
            elif channel.topic.startswith(_OURS):
                seen.faults[f"are of a kind that this version does not know ({channel.topic})"] += 1
            else:
                seen.parts[channel.topic] = written.log_time
    if seen.count != counted:
        yield RecordingIssue(grave=True, text=f"{seen.count} messages, where its summary counts {counted}")
    if found.session:
        # Its messages' causes from before it are in the session's own recording.
        seen.faults.pop(_CAUSE, None)
    if not seen.count:
        yield RecordingIssue(grave=True, text="it holds no message: record it again")
    elif not found.counts.get(topic_of(Episode)):
        yield RecordingIssue(grave=False, text="no message says how it began")
    for text, count in seen.faults.items():
        mended = text in (_INCOMPLETE, _TWICE)
        step = f"; `dipac recordings recover {found.path}` leaves them out" if mended else ""
        yield RecordingIssue(grave=text != _CAUSE, text=f"messages that {text}: {count}{step}")


def _look(message: Message, log_time_ns: int, seen: _Seen) -> None:
    """Check one of our messages: its order in time, its parts, its id and its causes."""
    if log_time_ns == seen.last_of_ours_ns:
        seen.faults["share their log time with another"] += 1
    seen.last_of_ours_ns = log_time_ns
    if any(seen.parts.get(topic) != log_time_ns for topic in part_topics(message)):
        seen.faults[_INCOMPLETE] += 1
    if message.id in seen.ids:
        seen.faults[_TWICE] += 1
    seen.ids.add(message.id)
    if not seen.ids.issuperset(message.cause):
        seen.faults[_CAUSE] += 1
