"""SHA-256 of each finished recording, in a file `SHA256SUMS` beside it that `sha256sum --check` reads as well."""

import hashlib
from collections.abc import Generator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Final

from app.core.errors import RecordingError, UsageError
from app.core.system.disk import replacement
from app.recording.format.lock import exclusive_folder

SUMS: Final = "SHA256SUMS"
_SUM: Final = 64
"""Characters of a sum; two more stand between it and the name."""


def digest(path: Path) -> str:
    """SHA-256 of the file, in hexadecimal."""
    with path.open("rb") as stream:
        return hashlib.file_digest(stream, "sha256").hexdigest()


def check_distinct(recordings: Mapping[Path, str]) -> None:
    """Raises UsageError where two recordings, by path with their digests, have the same content: only one may count."""
    said = list(recordings.values())
    twice = sorted({path.name for path, value in recordings.items() if said.count(value) > 1})
    if twice:
        raise UsageError(f"Recordings of the same content ({', '.join(twice)}) count once; leave out the others.")


def note(path: Path) -> None:
    """Store the file's current digest; a name of several lines cannot be stored.

    Raises RecordingError where the sums cannot be written.
    """
    if "\n" not in path.name:
        with _changing(path.parent) as lines:
            lines[path.name] = f"{digest(path)}  {path.name}"


def forget(path: Path) -> None:
    """Remove the file's digest. Raises RecordingError as `note`."""
    if (path.parent / SUMS).exists():
        with _changing(path.parent) as lines:
            lines.pop(path.name, None)


def stored_digest(path: Path) -> str | None:
    """Stored digest of the file, None where there is none. Raises RecordingError where the sums cannot be read."""
    line = _read(path.parent / SUMS).get(path.name)
    return line[:_SUM] if line else None


@contextmanager
def authorised_change(path: Path) -> Generator[None]:
    """Authorised change of the file: a digest that was correct before is updated afterwards.

    A digest that did not match before goes on not matching; a file without one gets none.

    Raises RecordingError as `note`.
    """
    before = stored_digest(path)
    sound = before is not None and before == digest(path)
    yield
    if sound:
        note(path)


@contextmanager
def _changing(folder: Path) -> Generator[dict[str, str]]:
    """The lines of a folder's sums by file name, rewritten at the end; other lines stay as they are."""
    file = folder / SUMS
    with exclusive_folder(folder):
        lines = _read(file)
        try:
            yield lines
            text = "".join(f"{line}\n" for _, line in sorted(lines.items()))
            with replacement(file) as new:
                new.write_text(text, encoding="utf-8", errors="surrogateescape")
        except OSError as error:
            raise RecordingError(f"Cannot write {file} ({error.strerror}); make its folder writable.") from error


def _read(file: Path) -> dict[str, str]:
    """Each line by its file name, in the text or the binary mode of `sha256sum`; other lines by themselves."""
    try:
        lines = file.read_text(encoding="utf-8", errors="surrogateescape").splitlines()
    except FileNotFoundError:
        return {}
    except OSError as error:
        raise RecordingError(f"Cannot read {file} ({error.strerror}); see who owns it.") from error
    return {_name(line): line for line in lines}


def _name(line: str) -> str:
    is_sum = line[_SUM : _SUM + 2] in ("  ", " *")
    return line[_SUM + 2 :].removeprefix("./") if is_sum else line
