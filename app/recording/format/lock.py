"""Locks of recordings being written: the writer holds one, and the system releases it when the process ends."""

import fcntl
import os
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from app.core.errors import RecordingError


def hold(path: Path) -> int:
    """Mark the file as being written, until the returned descriptor is closed."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    # Some network drives know no locks: there a file that is being written looks like one that was cut off. Otherwise a
    # lock is held no longer than it takes to ask.
    with suppress(OSError):
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    return descriptor


def is_being_written(path: Path) -> bool:
    """True while a process is writing the file."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        fcntl.flock(descriptor, fcntl.LOCK_SH | fcntl.LOCK_NB)
    except BlockingIOError:
        return True
    except OSError:
        return False
    finally:
        os.close(descriptor)
    return False


@contextmanager
def exclusive_folder(folder: Path) -> Generator[None]:
    """Mutual exclusion of programs that change a folder. Raises RecordingError where there is no such folder."""
    try:
        descriptor = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
    except OSError as error:
        raise RecordingError(f"Cannot open {folder} ({error.strerror}); see who owns it.") from error
    try:
        with suppress(OSError):
            fcntl.flock(descriptor, fcntl.LOCK_EX)
        yield
    finally:
        os.close(descriptor)
