"""Lines of results in a file: what is done is not done again, also after a line that a kill cut off."""

import json
from collections.abc import Iterator
from pathlib import Path
from typing import Any, cast


def lines(path: Path) -> Iterator[dict[str, Any]]:
    """The lines of the file, none where there is no file; one that was cut off in the middle counts for nothing."""
    for text in path.read_text(encoding="utf-8").splitlines() if path.exists() else ():
        try:
            line = json.loads(text)
        except ValueError:
            continue
        if isinstance(line, dict):
            yield cast(dict[str, Any], line)


def append(path: Path, line: dict[str, Any]) -> None:
    """At the end of the file, as a whole, also after a line that was cut off."""
    broken = path.exists() and path.stat().st_size and not path.read_bytes().endswith(b"\n")
    with path.open("a", encoding="utf-8") as file:
        file.write(("\n" if broken else "") + json.dumps(line) + "\n")
        file.flush()
