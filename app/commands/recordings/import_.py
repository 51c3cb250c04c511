"""Make a recording of data that were measured with other programs; the same as `dipac import`."""

from pathlib import Path
from typing import Annotated

import tyro

from app.commands import import_ as command


def import_(
    file: tyro.conf.Positional[Path],
    /,
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], help="the recording to write, a new .mcap file")],
    task: Annotated[str | None, tyro.conf.arg(help="the task, where the file does not name it")] = None,
) -> None:
    """Check everything, then write; where something is wrong, nothing is written."""
    command.import_(file, output=output, task=task)
