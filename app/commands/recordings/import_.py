"""Make a recording of measured data; the same as `dipac import`.

Example: dipac recordings import MEASURED.npz -o pushes.mcap
"""

from pathlib import Path
from typing import Annotated

import tyro

from app.commands import import_ as command
from app.commands._arguments import FileArgument


def import_(
    file: FileArgument,
    /,
    *,
    output: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], help="the recording to write, a new .mcap file")
    ] = None,
    task: Annotated[str | None, tyro.conf.arg(help="the task, where the file does not name it")] = None,
    cell: Annotated[Path | None, tyro.conf.arg(help="a real cell's TOML file that says where its table is")] = None,
    topics: Annotated[Path | None, tyro.conf.arg(help="a TOML file with the mapping, as --show prints it")] = None,
    show: Annotated[bool, tyro.conf.arg(help="print what is in the file, and write nothing")] = False,
) -> None:
    """Check everything, then write; where something is wrong, nothing is written."""
    command.import_(file, output=output, task=task, cell=cell, topics=topics, show=show)
