"""Atomic replacement of a recording: an interruption leaves the old file or the new one."""

import shutil
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from app.core.errors import RecordingError
from app.core.system.disk import replacement
from app.recording.format.lock import exclusive_folder, is_being_written


@contextmanager
def replace_file(path: Path) -> Generator[tuple[Path, Path]]:
    """The file at `path` (links resolved) and a path beside it for the new one, which replaces it at the end.

    The new one is forced to the disk first, and has the old one's times and permissions. Where anything is raised
    within, the old one stays and nothing else does. Raises RecordingError where it is being written or the disk
    refuses.
    """
    old = path.resolve()
    with exclusive_folder(old.parent):
        if is_being_written(old):
            raise RecordingError(f"{path} is being written; wait for its end.")
        try:
            with replacement(old) as new:
                yield old, new
                shutil.copystat(old, new)
        except OSError as error:
            raise RecordingError(
                f"Cannot write beside {path} ({error.strerror}); see its disk and its folder."
            ) from error
