"""Say whether recordings succeeded, or take it back.

Example: dipac recordings label success recordings/FILE.mcap --note 'all in place'
"""

import getpass
import os

import tyro
from rich.console import Console

from app.commands._arguments import Files
from app.core.errors import RecordingError, UsageError
from app.recording.format import digests
from app.recording.library.label import SUCCESS_LABELS, Label, SuccessLabel, relabel
from app.recording.library.recording_index import shelf


def label(
    said: tyro.conf.Positional[SuccessLabel],
    files: Files,
    /,
    *,
    note: str = "",
    operator: str | None = None,
) -> None:
    """The label becomes part of the file, which is replaced at once; earlier labels stay in it.

    Args:
        said: success, failure, or unlabelled.
        files: the recordings, or folders of them.
        note: the reason, in words.
        operator: name of the person; the user who is logged in where none is named.
    """
    if not files:
        raise UsageError(f"Name at least one recording: dipac recordings label {'|'.join(SUCCESS_LABELS)} FILE...")
    terminal = Console(highlight=False, soft_wrap=True, markup=False)
    told, entries = Label.now(said, note=note, operator=operator or _user()), shelf(files)
    for entry in entries:
        if entry.condition != "whole":
            raise RecordingError(f"{entry.state} So nothing was labelled.")
    for entry in entries:
        with digests.authorised_change(entry.path):
            relabel(entry.path, told)
        terminal.print(f"{entry.path}: {said}{f', {note}' if note else ''}")


def _user() -> str:
    try:
        return getpass.getuser()
    except (KeyError, OSError):  # A container may have no name for whoever runs it.
        return f"uid {os.getuid()}"
