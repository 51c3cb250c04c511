"""Make cut or damaged recordings whole; as `dipac recover`.

Example: dipac recordings recover recordings/FILE.mcap
"""

from pathlib import Path

import tyro

from app.commands import recover as command


def recover(files: tyro.conf.Positional[tuple[Path, ...]], /) -> None:
    """Make whole files of recordings that were cut off or damaged; the originals stay as they are.

    Args:
        files: The recordings. Each gets a NAME.recovered.mcap beside it, unless nothing is wrong with it.
    """
    command.recover(files=files)
