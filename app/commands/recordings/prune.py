"""Delete old recordings, by size or age; labelled ones stay.

Example: dipac recordings prune recordings --keep-gb 20
"""

import math
from pathlib import Path

from rich.console import Console

from app.commands._arguments import Places
from app.core.dialogue.words import size
from app.core.errors import UsageError
from app.recording.library.prune import Rule, discard, prunable
from app.recording.library.recording_index import shelf


def prune(
    places: Places = (Path("recordings"),),
    /,
    *,
    keep_gb: float | None = None,
    days: float | None = None,
    all_kinds: bool = False,
    yes: bool = False,
) -> None:
    """Labelled recordings and demonstrations stay, and whatever is being written.

    Args:
        places: folders or files.
        keep_gb: so much may stay; the oldest beyond it go.
        days: those that are older go.
        all_kinds: labelled recordings and demonstrations may go, too.
        yes: delete; without it, only what would be deleted is said.
    """
    for option, given in (("--keep-gb", keep_gb), ("--days", days)):
        if given is not None and not 0 <= given < math.inf:
            raise UsageError(f"{option} {given} must be a number, and not negative.")
    if keep_gb is None and days is None:
        raise UsageError("Say what is too much: --keep-gb 20 keeps the newest 20 GB, --days 30 the last thirty days.")
    terminal = Console(highlight=False, soft_wrap=True, markup=False)
    entries = shelf(places)
    rule = Rule(keep_bytes=None if keep_gb is None else round(keep_gb * 1e9), days=days, all_kinds=all_kinds)
    going = prunable(entries, rule)
    for entry in going:
        if yes:
            discard(entry.path)
        terminal.print(f"{'deleted' if yes else 'would delete'}  {entry.path}  {size(entry.size_bytes)}")
    left = sum(entry.size_bytes for entry in entries) - sum(entry.size_bytes for entry in going)
    terminal.print(f"{len(going)} of {len(entries)} recordings; {size(left)} {'stay' if yes else 'would stay'}.")
    if keep_gb is not None and left > keep_gb * 1e9:
        kept, more = ("", "") if all_kinds else ("labelled, to be learnt from, ", "; see --all-kinds")
        terminal.print(f"What is {kept}unreadable or being written takes more{more}.")
    if going and not yes:
        terminal.print("Nothing was deleted; add --yes to do it.")
