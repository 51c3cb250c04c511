"""Deletion of old recordings. Labelled ones and demonstrations are kept."""

import time
from collections.abc import Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import final

from app.core.errors import RecordingError
from app.recording.format import digests
from app.recording.format.lock import is_being_written
from app.recording.library.recording_index import Entry

_DAY_S, _JUST_S = 86400.0, 600.0


@final
@dataclass(frozen=True, kw_only=True)
class Rule:
    """Retention limit: `keep_bytes` in all, and an age of `days`. Without either, everything is kept.

    `all_kinds`: delete labelled ones and demonstrations too.
    """

    keep_bytes: int | None = None
    days: float | None = None
    all_kinds: bool = False


def prunable(entries: Sequence[Entry], rule: Rule, *, now_s: float | None = None) -> Sequence[Entry]:
    """Entries to delete under the rule, oldest first.

    Never one that is being written, or that cannot be read: it may be another program's.
    """
    moment_s = time.time() if now_s is None else now_s
    free = [entry for entry in entries if _loose(entry, rule, moment_s)]
    gone = {entry.path for entry in free if rule.days is not None and _age_s(entry, moment_s) > rule.days * _DAY_S}
    if rule.keep_bytes is not None:
        left = sum(entry.size_bytes for entry in entries if entry.path not in gone)
        for entry in free:
            if left > rule.keep_bytes and entry.path not in gone:
                gone.add(entry.path)
                left -= entry.size_bytes
    return [entry for entry in free if entry.path in gone]


def discard(path: Path) -> None:
    """Delete a recording and its checksum. Raises RecordingError where that fails, or it is being written."""
    try:
        if is_being_written(path):
            raise RecordingError(f"{path} is being written; it stays.")
        path.unlink()
    except OSError as error:
        raise RecordingError(f"Cannot delete {path} ({error.strerror}); see who owns it.") from error
    digests.forget(path)


def _loose(entry: Entry, rule: Rule, now_s: float) -> bool:
    if entry.condition in ("recording", "unreadable"):
        return False
    # On a drive without locks a recording that is being written looks like this.
    if entry.condition == "cut off" and now_s - _changed_s(entry) < _JUST_S:
        return False
    return rule.all_kinds or not (entry.said or entry.demonstration)


def _age_s(entry: Entry, now_s: float) -> float:
    """Age since its start, or since its creation where that is later: imported data have clocks of their own."""
    began_s = entry.began.timestamp() if entry.began else now_s
    return min(now_s - began_s, now_s - _changed_s(entry))


def _changed_s(entry: Entry) -> float:
    with suppress(OSError):
        return entry.path.stat().st_mtime
    return float("inf")
