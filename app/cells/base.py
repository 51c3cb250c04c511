"""What a cell is to the commands: where its arm may be, and how it is opened."""

from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from dataclasses import dataclass
from pathlib import Path
from typing import TypeAlias, final

from app.config import Site
from app.core.errors import UsageError
from app.core.ports import Rig
from app.tasks.base import Task


@final
@dataclass(frozen=True, kw_only=True)
class Wanted:
    """What a command opens a cell for. `seed` draws the start of what is simulated; `file` describes a real cell."""

    task: Task
    site: Site
    seed: int
    file: Path | None = None


Open: TypeAlias = Callable[[Wanted], AbstractAsyncContextManager[Rig]]


@final
@dataclass(frozen=True, kw_only=True)
class Cell:
    """A cell by its name. `simulated`: nothing real can move; `narrowed`: the site with what its file says, if any."""

    name: str
    simulated: bool
    open: Open
    narrowed: Callable[[Site, Path | None], Site]


def as_it_is(site: Site, file: Path | None) -> Site:
    """The site of a cell that no file describes. Raises UsageError where one is given."""
    if file is not None:
        raise UsageError(f"--cell {file} describes a real cell; choose one with --rig as well, or leave it out.")
    return site
