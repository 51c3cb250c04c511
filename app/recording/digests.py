"""SHA-256 of each finished recording, in a file `SHA256SUMS` beside it that `sha256sum --check` reads as well."""

import fcntl
import hashlib
import os
from collections.abc import Generator
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from app.core.errors import RecordingError

SUMS: Final = "SHA256SUMS"


def digest(path: Path) -> str:
    """The SHA-256 of the file, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def note(path: Path) -> None:
    """Write down what the file is now. Raises RecordingError where that cannot be written."""
    with _changing(path.parent) as sums:
        sums[path.name] = digest(path)


def forget(path: Path) -> None:
    """Strike it out. Raises RecordingError as `note`."""
    if (path.parent / SUMS).exists():
        with _changing(path.parent) as sums:
            sums.pop(path.name, None)


def noted(path: Path) -> str | None:
    """What was written down of it, None where nothing was."""
    return _read(path.parent / SUMS).get(path.name)


@contextmanager
def _changing(folder: Path) -> Generator[dict[str, str]]:
    """The sums of a folder, written anew at the end; two programs that do so take turns."""
    file = folder / SUMS
    try:
        lock = os.open(folder, os.O_RDONLY | os.O_CLOEXEC)
        try:
            fcntl.flock(lock, fcntl.LOCK_EX)
            sums = _read(file)
            yield sums
            new = file.with_name(f".{SUMS}.new")
            new.write_text("".join(f"{value}  {name}\n" for name, value in sorted(sums.items())), encoding="utf-8")
            new.replace(file)
        finally:
            os.close(lock)
    except OSError as error:
        raise RecordingError(f"Cannot write {file} ({error.strerror}); make its folder writable.") from error


def _read(file: Path) -> dict[str, str]:
    """Name and sum of each line that has both, in the text or the binary mode of `sha256sum`."""
    try:
        lines = file.read_text(encoding="utf-8").splitlines()
    except OSError:
        return {}
    return {line[66:]: line[:64] for line in lines if line[64:66] in ("  ", " *")}
