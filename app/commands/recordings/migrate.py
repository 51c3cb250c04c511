"""Rewrite recordings of older versions as the newest one's.

Example: dipac recordings migrate recordings --dry-run
"""

from rich.console import Console

from app.commands._arguments import Files
from app.core.errors import RecordingError, UsageError
from app.recording.format.channels import SCHEMA_VERSION
from app.recording.format.integrity import version_of
from app.recording.library.recording_index import shelf
from app.recording.library.renew import renew


def migrate(
    files: Files,
    /,
    *,
    dry_run: bool = False,
) -> None:
    """Old recordings are read as they are; rewritten, other programs find in them what is documented.

    Each file is replaced at once, with its labels; one of the newest version is left alone.

    Args:
        files: the recordings, or folders of them.
        dry_run: only say what would be done.
    """
    if not files:
        raise UsageError("Name at least one recording: dipac recordings migrate FILE...")
    terminal, entries = Console(highlight=False, soft_wrap=True, markup=False), shelf(files)
    for entry in entries:
        if entry.condition != "whole":
            raise RecordingError(f"{entry.state} So nothing was rewritten.")
    old = [entry for entry in entries if version_of(entry.metadata) < SCHEMA_VERSION]
    for entry in old:
        if not dry_run:
            renew(entry.path)
        done = "would be" if dry_run else "was"
        terminal.print(f"{entry.path}: {done} rewritten from version {version_of(entry.metadata)} to {SCHEMA_VERSION}")
    terminal.print(f"{len(entries) - len(old)} of {len(entries)} recordings are of version {SCHEMA_VERSION} already.")
