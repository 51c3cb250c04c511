"""Results as lines of a file: finished episodes are not repeated, even after a line that a kill cut off."""

import fcntl
import json
import os
from collections.abc import Generator, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, cast

from app.core.errors import UsageError


@contextmanager
def folder_lock(folder: Path) -> Generator[None]:
    """Lock on the folder. Raises UsageError if another process holds it."""
    here = os.open(folder, os.O_RDONLY)
    try:
        fcntl.flock(here, fcntl.LOCK_EX | fcntl.LOCK_NB)
        yield
    except BlockingIOError:
        raise UsageError(f"Another evaluation writes to {folder}; wait for it, or choose another with -o.") from None
    finally:
        os.close(here)


def lines(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of the file, none where there is no file; one that was cut off in the middle counts for nothing."""
    for text in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            line = json.loads(text)
        except ValueError:
            continue
        if isinstance(line, dict):
            yield cast(dict[str, Any], line)


def latest(path: Path) -> list[dict[str, Any]]:
    """The last line of each `key`, in the order in which keys first came."""
    return list({line["key"]: line for line in lines(path) if "key" in line}.values())


def append(path: Path, line: dict[str, Any]) -> None:
    """Append the line to the file as a whole, even after a line that was cut off."""
    broken = path.exists() and path.stat().st_size and not path.read_bytes().endswith(b"\n")
    with path.open("a", encoding="utf-8") as file:
        file.write(("\n" if broken else "") + json.dumps(line) + "\n")
        file.flush()
