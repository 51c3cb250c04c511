"""Make the recording of a killed run whole.

Example: dipac recover recordings/FILE.mcap
"""

from rich.console import Console

from app.commands._arguments import Files
from app.core.errors import UsageError
from app.recording.library import recover as recording


def recover(*, files: Files) -> None:
    """Make whole files of recordings that were cut off or damaged; the originals stay as they are.

    Args:
        files: recordings. Each gets a NAME.recovered.mcap beside it, unless nothing is wrong with it.
    """
    if not files:
        raise UsageError("Name at least one recording: dipac recover FILE...")
    terminal = Console(highlight=False, soft_wrap=True, markup=False, emoji=False)
    for path in files:
        result = recording.recover(path)
        if result.was_whole:
            terminal.print(f"{path} is whole: {result.messages} messages, nothing to do.")
        else:
            left_out = "".join(f" Left out on {topic}: {count}." for topic, count in result.left_out.items())
            terminal.print(
                f"{result.path}: {result.messages} messages; {result.lost_bytes} bytes of {path} could not be read."
                f"{left_out}"
            )
