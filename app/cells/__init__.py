"""Rigs assembled from their parts, one file a cell: its name is the value of `--rig`, and it defines `CELL`."""

import importlib
import re
from functools import cache
from pathlib import Path

from app.cells.base import Cell
from app.core.errors import UsageError

_DEFINES = re.compile(r"^CELL: Final = ", re.MULTILINE)


@cache
def names() -> list[str]:
    """Names of all cells: the files of this folder that define `CELL`, which are scanned for it and not imported."""
    return sorted(file.stem for file in Path(__file__).parent.glob("*.py") if _DEFINES.search(file.read_text()))


def load(name: str) -> Cell:
    """The cell of that name. Raises UsageError where there is none."""
    if name not in names():
        raise UsageError.unknown("rig", name, names())
    cell: Cell = importlib.import_module(f"app.cells.{name}").CELL
    return cell
