"""Lines of results in a file: what is done is not done again, and files of several machines are read as one."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any

from app.evaluation.ledger import lines


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
        for line in lines(path):
            if "case" in line and ("verdict" in line or "verdict" not in found.get(key_of(line), {})):
                found[key_of(line)] = line
    return list(found.values())


def finished(known: Sequence[dict[str, Any]]) -> list[dict[str, Any]]:
    """Those with a verdict."""
    return [line for line in known if "verdict" in line and "truth" in line]
