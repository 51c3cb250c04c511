"""Make cut or damaged recordings whole; as `dipac recover`.

Example: dipac recordings recover recordings/FILE.mcap
"""

from app.commands import recover as command
from app.commands._arguments import Files


def recover(files: Files, /) -> None:
    """Make whole files of recordings that were cut off or damaged; the originals stay as they are.

    Args:
        files: recordings. Each gets a NAME.recovered.mcap beside it, unless nothing is wrong with it.
    """
    command.recover(files=files)
