"""List the recordings in a folder: a line each, oldest first.

Example: dipac recordings list recordings
"""

import json as json_format
import sys
from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from app.commands._arguments import Places
from app.commands._progress import print_whole
from app.core.dialogue.words import NOTHING, duration, size
from app.recording.library.recording_index import Entry, shelf

_TONES = {"whole": "", "recording": "green", "cut off": "yellow", "unreadable": "red"}


def list_(
    places: Places = (Path("recordings"),),
    /,
    *,
    json: bool = False,
) -> None:
    """Folders are searched through and through; nothing but the first and the last bytes of a file is read.

    Args:
        places: folders or files.
        json: print one JSON array instead, for programs.
    """
    entries = shelf(places)
    if json:
        json_format.dump([entry.row() for entry in entries], sys.stdout, indent=2)
        sys.stdout.write("\n")
        return
    terminal = Console(highlight=False, soft_wrap=True)
    if not entries:
        terminal.print(f"No recordings in {', '.join(map(str, places))}; `dipac run` and `dipac collect` make some.")
        return
    table = Table("recording", "began (UTC)", "task", "length", "size", "pushes", "faults", "label", "", box=None)
    for entry in entries:
        table.add_row(*_cells(entry), style=_TONES[entry.condition])
    print_whole(terminal, table)
    terminal.print(f"{len(entries)} recordings, {size(sum(entry.size_bytes for entry in entries))}.")
    if any(entry.condition == "cut off" for entry in entries):
        terminal.print("Cut off by a crash: `dipac recordings recover FILE...` makes whole files of them.")


def _cells(entry: Entry) -> list[Text]:
    began = f"{entry.began:%Y-%m-%d %H:%M:%S}" if entry.began else NOTHING
    whole = entry.condition == "whole"
    told = (
        *(str(entry.path), began, entry.task or NOTHING, duration(entry.duration_s), size(entry.size_bytes)),
        *(str(entry.pushes) if whole else NOTHING, str(entry.faults) if whole else NOTHING),
        entry.said or ("demonstration" if entry.demonstration else NOTHING),
        "" if whole else entry.condition,
    )
    return [Text(cell) for cell in told]
