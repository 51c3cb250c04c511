"""Check recordings: every byte, message, cause and checksum.

Example: dipac recordings check recordings --note
"""

from pathlib import Path

from rich.console import Console
from rich.text import Text

from app.commands._arguments import Places
from app.commands._progress import counting
from app.core.errors import RecordingError
from app.recording.format import digests
from app.recording.library.checks import check as examine
from app.recording.library.recording_index import shelf


def check(
    places: Places = (Path("recordings"),),
    /,
    *,
    note: bool = False,
) -> None:
    """Reads all of every file. Ends with code 4 where part of one is lost or cannot be trusted.

    Args:
        places: folders or files.
        note: write down the SHA-256 of those that have none yet and in which nothing is wrong.
    """
    terminal = Console(highlight=False, soft_wrap=True)
    entries, bad = shelf(places), list[Path]()
    with counting(terminal) as progress:
        bar = progress.add_task("recordings", total=len(entries))
        for entry in entries:
            findings = examine(entry.path)
            if any(finding.grave for finding in findings):
                bad.append(entry.path)
            elif note and entry.condition == "whole" and digests.stored_digest(entry.path) is None:
                digests.note(entry.path)
            verdict = ("bad", "red") if entry.path in bad else ("good", "green")
            progress.console.print(Text.assemble(verdict, f"  {entry.path}"))
            for finding in findings:
                progress.console.print(Text(f"      {finding.text}", "red" if finding.grave else ""))
            progress.update(bar, advance=1)
    terminal.print(f"{len(entries) - len(bad)} of {len(entries)} recordings are good.")
    if bad:
        raise RecordingError(f"Part of {len(bad)} recordings is lost or cannot be trusted; see above.")
