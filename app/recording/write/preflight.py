"""Preconditions on the recordings folder before an episode starts."""

import shutil
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import final

from app.core.errors import PreflightError


@final
@dataclass(frozen=True, kw_only=True)
class Room:
    """Disk limits of an episode: `min_free_bytes` to leave free, and `budget_bytes` of recordings in all.

    `expected_bytes`: its own expected size, so that it is refused before it begins and not cut off in its middle.
    """

    min_free_bytes: int = 0
    expected_bytes: int = 0
    budget_bytes: int | None = None


def check_folder(folder: Path, room: Room) -> None:
    """Make sure that `folder` exists, can be written to and has room; creates it where it is missing.

    Raises PreflightError, in one line with the next step.
    """
    if folder.exists() and not folder.is_dir():
        raise PreflightError(f"{folder} is a file, not a folder; move it away or choose another recordings folder.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(b"dipac")
        taken_bytes = _taken_bytes(folder) if room.budget_bytes is not None else 0
    except OSError as error:
        raise PreflightError(
            f"Cannot write to {folder} ({error.strerror}); make it writable or choose another recordings folder."
        ) from error
    free_bytes, wanted_bytes = shutil.disk_usage(folder).free, room.min_free_bytes + room.expected_bytes
    if free_bytes < wanted_bytes:
        raise PreflightError(
            f"Only {_gb(free_bytes)} are free in {folder}, an episode wants {_gb(wanted_bytes)}; delete old recordings "
            f"(`dipac recordings prune {folder}` says which may go) or choose another folder."
        )
    if room.budget_bytes is not None and taken_bytes + room.expected_bytes > room.budget_bytes:
        raise PreflightError(
            f"The recordings in {folder} take {_gb(taken_bytes)} of {_gb(room.budget_bytes)}, and this episode may "
            f"take {_gb(room.expected_bytes)}; make room with `dipac recordings prune {folder}`, or raise --budget-gb."
        )


def _taken_bytes(folder: Path) -> int:
    return sum(path.stat().st_size for path in folder.rglob("*.mcap") if path.is_file())


def _gb(count: int) -> str:
    return f"{count / 1e9:.2f} GB"
