"""Free space on a disk, and files that are replaced at once."""

import errno
import os
import shutil
import tempfile
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

_STEM: Final = 40
"""Characters of a name that are kept in a hidden one: at four bytes each, and with the rest, less than 255."""


def free_bytes(folder: Path) -> int:
    """Free bytes on the disk of `folder`; 0 where the folder is gone. May block on a slow disk."""
    try:
        return shutil.disk_usage(folder).free
    except OSError:
        return 0


def path_beside(path: Path, suffix: str) -> Path:
    """Hidden path in the folder of `path`, for this process alone; as short as `path`, or short enough for any disk."""
    return path.with_name(f".{path.stem[:_STEM]}.{os.getpid()}{suffix}")


def link_target(path: Path) -> Path:
    """The file that is written where `path` is: the one that a link leads to. Raises OSError for a circle of links."""
    try:
        return path.resolve()
    except RuntimeError:  # Python 3.12 and before.
        raise OSError(errno.ELOOP, os.strerror(errno.ELOOP), str(path)) from None


def is_stream(path: Path) -> bool:
    """True for a device or a pipe: it is written into, and never replaced."""
    return path.exists() and not path.is_file() and not path.is_dir()


@contextmanager
def replacement(path: Path) -> Generator[Path]:
    """A path to write a new file to, which takes the place of the one at `path` at the end, with its permissions.

    An interruption leaves the old file or the new one, and an error the old one. A link stays: the file that it leads
    to is replaced. A device or pipe gets the content. Raises OSError where the disk refuses.
    """
    stream = is_stream(path)
    goal = path if stream else link_target(path)
    new = path_beside(Path(tempfile.gettempdir(), path.name) if stream else goal, ".new")
    try:
        yield new
        if stream:
            with new.open("rb") as source, path.open("wb") as target:
                shutil.copyfileobj(source, target)
            return
        _put_on_disk(new)
        if goal.exists():
            shutil.copymode(goal, new)
        new.replace(goal)
    finally:
        new.unlink(missing_ok=True)


def _put_on_disk(path: Path) -> None:
    descriptor = os.open(path, os.O_RDONLY | os.O_CLOEXEC)
    try:
        os.fsync(descriptor)
    finally:
        os.close(descriptor)
