"""Which recordings may go, and letting them go. What somebody labelled or made to learn from stays."""

import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from app.core.errors import RecordingError
from app.recording import digests
from app.recording.shelf import Entry

_DAY_S: Final = 86400.0


@final
@dataclass(frozen=True, kw_only=True)
class Rule:
    """What is too much: more than `keep_bytes` together, or older than `days`. Without either nothing is.

    `all_kinds`: labelled ones and demonstrations too.
    """

    keep_bytes: int | None = None
    days: float | None = None
    all_kinds: bool = False


def prunable(entries: Sequence[Entry], rule: Rule, *, now_s: float | None = None) -> Sequence[Entry]:
    """Those of `entries`, oldest first, that the rule lets go.

    Never one that is being written, or that cannot be read: it may be another program's.
    """
    moment_s = time.time() if now_s is None else now_s
    free = [entry for entry in entries if _loose(entry, rule)]
    gone = {entry.path for entry in free if rule.days is not None and _age_s(entry, moment_s) > rule.days * _DAY_S}
    if rule.keep_bytes is not None:
        left = sum(entry.size_bytes for entry in entries if entry.path not in gone)
        for entry in free:
            if left > rule.keep_bytes and entry.path not in gone:
                gone.add(entry.path)
                left -= entry.size_bytes
    return [entry for entry in free if entry.path in gone]


def discard(path: Path) -> None:
    """Delete a recording, and its checksum with it. Raises RecordingError where that cannot be."""
    try:
        path.unlink()
    except OSError as error:
        raise RecordingError(f"Cannot delete {path} ({error.strerror}); see who owns it.") from error
    digests.forget(path)


def _loose(entry: Entry, rule: Rule) -> bool:
    if entry.condition in ("recording", "unreadable"):
        return False
    return rule.all_kinds or not (entry.said or entry.demonstration)


def _age_s(entry: Entry, now_s: float) -> float:
    return now_s - entry.began.timestamp() if entry.began else 0.0
