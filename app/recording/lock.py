"""Which recordings are being written: their writer holds a lock, which the system lifts when the process ends."""

import fcntl
import os
from contextlib import suppress
from pathlib import Path


def hold(path: Path) -> int:
    """Mark the file as being written, until the descriptor that is returned is closed."""
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    # Some network drives know no locks: there a file that is being written looks like one that was cut off.
    with suppress(OSError):
        fcntl.flock(descriptor, fcntl.LOCK_EX | fcntl.LOCK_NB)
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
