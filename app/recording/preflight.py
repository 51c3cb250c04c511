"""What must be true of the recordings folder before an episode starts."""

import shutil
import tempfile
from pathlib import Path

from app.core.errors import PreflightError


def check_folder(folder: Path, *, min_free_bytes: int) -> None:
    """Make sure that `folder` exists, can be written to and has room; creates it where it is missing.

    Raises PreflightError, in one line with the next step.
    """
    if folder.exists() and not folder.is_dir():
        raise PreflightError(f"{folder} is a file, not a folder; move it away or choose another recordings folder.")
    try:
        folder.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=folder) as probe:
            probe.write(b"dipac")
    except OSError as error:
        raise PreflightError(
            f"Cannot write to {folder} ({error.strerror}); make it writable or choose another recordings folder."
        ) from error
    free_bytes = shutil.disk_usage(folder).free
    if free_bytes < min_free_bytes:
        raise PreflightError(
            f"Only {free_bytes / 1e9:.2f} GB are free in {folder}, an episode wants {min_free_bytes / 1e9:.2f} GB; "
            "delete old recordings or choose another folder."
        )
