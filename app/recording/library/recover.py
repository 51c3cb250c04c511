"""Recovery of a recording that a crash cut off or a disk damaged."""

from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from typing import final

from mcap.reader import make_reader

from app.core.errors import RecordingError
from app.core.system.disk import link_target, path_beside
from app.recording.format import digests
from app.recording.format.integrity import DAMAGE, damage_of, ends_as_mcap, reading, require_file, starts_as_mcap
from app.recording.format.lock import is_being_written
from app.recording.library.label import LABEL, labels
from app.recording.library.salvage import Salvage
from app.recording.write.append import append_metadata
from app.recording.write.copying import write_records


@final
@dataclass(frozen=True, kw_only=True)
class Recovered:
    """Result of a recovery.

    `path` is the new file, or the old one where it was sound (`was_whole`); `messages` counts its messages on all
    channels; `lost_bytes` of the old file were invalid, and `left_out` counts its invalid messages, by topic.
    """

    path: Path
    messages: int
    lost_bytes: int
    was_whole: bool
    left_out: Mapping[str, int] = field(default_factory=dict[str, int])


def recover(path: Path) -> Recovered:
    """Write all that is intact in the recording at `path` to a new, indexed file `NAME.recovered.mcap` beside it.

    That is everything but damaged chunks, messages that cannot be read, and those that are there twice. The original
    is left as it is; a file in which nothing is damaged is not copied.

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
    draft = path_beside(goal, ".draft")
    try:
        salvage = Salvage(path)
        messages = write_records(salvage, draft)
        if messages == 0:
            raise RecordingError(f"{path} holds no message that is intact; there is nothing to recover.")
        sound = salvage.lost_bytes == 0 and not salvage.left_out
        if sound and ends_as_mcap(path) and not damage_of(path) and _is_whole(path, messages):
            return Recovered(path=path, messages=messages, lost_bytes=0, was_whole=True)
        for label in labels(goal) if goal.is_file() else ():  # Labels of an earlier recovery.
            append_metadata(draft, LABEL, label.written())
        draft.replace(link_target(goal))
        digests.note(goal)
    except OSError as error:
        raise RecordingError(
            f"Cannot recover {path} to {goal.name} ({error.strerror}); "
            "copy it to a folder that has room and may be written to."
        ) from None
    finally:
        draft.unlink(missing_ok=True)
    return Recovered(
        path=goal, messages=messages, lost_bytes=salvage.lost_bytes, was_whole=False, left_out=salvage.left_out
    )


def _is_whole(path: Path, messages: int) -> bool:
    """True where the index leads to as many messages as a scan finds."""
    with path.open("rb") as stream:
        try:
            reader = make_reader(stream, validate_crcs=True)
            return any(True for _ in reader.iter_metadata()) and messages == sum(1 for _ in reader.iter_messages())
        except DAMAGE:
            return False
