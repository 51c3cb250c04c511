"""Which recordings are being written: their writer holds a lock, which the system lifts when the process ends."""

import fcntl
import os
from collections.abc import Generator
from contextlib import contextmanager, suppress
from pathlib import Path

from app.core.errors import RecordingError


def hold(path: Path) -> int:
    """Mark the file as being written, until the descriptor that is returned is closed."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    # Some network drives know no locks: there a file that is being written looks like one that was cut off. Otherwise
    # nobody has one for longer than it takes to ask.
    with suppress(OSError):
        fcntl.flock(descriptor, fcntl.LOCK_EX)
    return descriptor


def held(path: Path) -> bool:
    """Whether somebody is writing the file."""
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
def locked(folder: Path) -> Generator[None]:
    """Two programs that change what is in a folder take turns. Raises RecordingError where there is no such folder."""
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
