"""Recordings for other programs: a LeRobot dataset, arrays (.npz) or clouds (.ply)."""

from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import tyro
from rich.console import Console
from rich.progress import TimeRemainingColumn

from app.commands._preflight import make_folder
from app.commands._progress import counting
from app.core.errors import UsageError
from app.recording.clouds import What, write_npz, write_ply
from app.recording.shelf import Entry, shelf

Format: TypeAlias = Literal["lerobot", "npz", "ply"]
_FASTEST_FPS = 100


def export(
    places: tyro.conf.Positional[tuple[Path, ...]],
    /,
    *,
    to: Format,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
    fps: int = 10,
    labelled: Literal["success", "failure"] | None = None,
    what: What = "surface",
) -> None:
    """Files that were cut off are left out, and named.

    Args:
        places: recordings, or folders of them.
        to: lerobot: one dataset in LeRobot's format v3.0, an episode a recording, for training; npz: arrays of each
            recording, as `dipac import` reads them; ply: a folder of clouds for each recording.
        output: a folder, new or empty.
        fps: steps a second of a LeRobot dataset.
        labelled: only those that were labelled so.
        what: the clouds of PLY files: the surface that cameras saw, or the particles that fill it.
    """
    terminal = Console(highlight=False, soft_wrap=True, markup=False)
    if not 1 <= fps <= _FASTEST_FPS:
        raise UsageError(f"--fps {fps} must be from 1 to {_FASTEST_FPS}.")
    entries = _chosen(terminal, shelf(places), labelled)
    make_folder(output, "-o")
    if any(output.iterdir()):
        raise UsageError(f"{output} is not empty; choose another folder with -o, so that nothing is written over.")
    with counting(terminal, TimeRemainingColumn()) as progress:
        bar = progress.add_task("recordings", total=len(entries))
        told = _write([entry.path for entry in entries], output, to, fps, what, lambda _: progress.advance(bar))
    terminal.print(f"{output}: {told}")


def _chosen(terminal: Console, entries: Sequence[Entry], labelled: str | None) -> Sequence[Entry]:
    for entry in entries:
        if entry.condition != "whole":
            terminal.print(f"{entry.path} is left out: {entry.condition}. {entry.why}")
    chosen = [it for it in entries if it.condition == "whole" and labelled in (None, it.said)]
    if not chosen:
        kind = f" labelled {labelled}" if labelled else ""
        raise UsageError(f"There is no whole recording{kind} among {len(entries)}; see `dipac recordings list`.")
    return chosen


def _write(
    paths: Sequence[Path], folder: Path, to: Format, fps: int, what: What, done: Callable[[Path], object]
) -> str:
    """Write all of them; returns what was written, in words."""
    if to == "lerobot":
        from app.recording.lerobot import dataset  # Others do not need its packages.

        exported = dataset.export(paths, folder, fps=fps, done=done)
        return f"{exported.episodes} episodes, {exported.steps} steps at {fps} a second."
    count = 0
    for path in paths:
        count += (
            write_npz(path, folder / f"{path.stem}.npz") if to == "npz" else write_ply(path, folder / path.stem, what)
        )
        done(path)
    return f"{count} {'pushes' if to == 'npz' else 'clouds'} of {len(paths)} recordings."
