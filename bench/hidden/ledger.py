"""Lines of results in a file: what is done is not done again, and files of several machines are read as one."""

import json
from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any


def key_of(line: dict[str, Any]) -> str:
    """What tells a line from others: the world, the seed, the number and the size of the study."""
    case = line["case"]
    return "-".join(str(case[name]) for name in ("world", "seed", "number", "episodes", "pushes"))


def read(paths: Iterable[Path]) -> list[dict[str, Any]]:
    """The lines of all files that exist, each case once: the last line of it that has a verdict, else the last.

    A line that was cut off in the middle counts for nothing.
    """
    found = dict[str, dict[str, Any]]()
    for path in paths:
        for text in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
            line = _line(text)
            if line is not None and ("verdict" in line or "verdict" not in found.get(key_of(line), {})):
                found[key_of(line)] = line
    return list(found.values())


def append(path: Path, line: dict[str, Any]) -> None:
    """At the end of the file, as a whole, also after a line that was cut off."""
    broken = path.exists() and path.stat().st_size and not path.read_bytes().endswith(b"\n")
    with path.open("a", encoding="utf-8") as file:
        file.write(("\n" if broken else "") + json.dumps(line) + "\n")
        file.flush()


def finished(lines: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Those with a verdict."""
    return [line for line in lines if "verdict" in line and "truth" in line]


def _line(text: str) -> dict[str, Any] | None:
    try:
        line = json.loads(text)
    except ValueError:
        return None
    return line if isinstance(line, dict) and "case" in line else None
