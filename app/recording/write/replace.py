"""Atomic replacement of a recording: an interruption leaves the old file or the new one."""

import os
import shutil
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path

from app.core.errors import RecordingError
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
        new = old.with_name(f".{old.name}.{os.getpid()}.new")
        try:
            yield old, new
            _put_on_disk(new)
            shutil.copystat(old, new)
            new.replace(old)
        except OSError as error:
            raise RecordingError(
                f"Cannot write beside {path} ({error.strerror}); see its disk and its folder."
            ) from error
        finally:
            new.unlink(missing_ok=True)


def _put_on_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
