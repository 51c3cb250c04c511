"""Write recordings for other programs: LeRobot, arrays, clouds.

Example: dipac recordings export recordings --to lerobot -o dataset
"""

import shutil
from collections.abc import Generator, Sequence
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Literal, TypeAlias

import tyro
from rich.console import Console
from rich.progress import Progress, TaskID, TimeRemainingColumn

from app.commands._arguments import Places
from app.commands._preflight import make_folder, unwritable
from app.commands._progress import counting
from app.core.bounds import check_range
from app.core.errors import RecordingError, UsageError
from app.core.system.disk import link_target, path_beside
from app.core.task_name import TaskName
from app.recording.format.names import numbered_names
from app.recording.library.recording_index import Entry, shelf
from app.recording.read.clouds import What, write_npz, write_ply
from app.tasks import load, names

Format: TypeAlias = Literal["lerobot", "npz", "ply"]
_FASTEST_FPS = 100
_LONGEST_REST_S = 10.0


def export(
    places: Places,
    /,
    *,
    to: Format,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
    fps: int = 10,
    rest: float = 0.5,
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
        rest: seconds after each motion that are part of it, in which the arm rests and its result is seen; 0 for none.
        labelled: only those that were labelled so.
        what: the clouds of PLY files: the surface that cameras saw, or the particles that fill it.
    """
    terminal = Console(highlight=False, soft_wrap=True, markup=False)
    if not 1 <= fps <= _FASTEST_FPS:
        raise UsageError(f"--fps {fps} must be from 1 to {_FASTEST_FPS}.")
    check_range("--rest", rest, 0.0, _LONGEST_REST_S)
    entries = _chosen(terminal, shelf(places), labelled)
    if output.exists() and (not output.is_dir() or any(output.iterdir())):
        raise UsageError(f"{output} is not an empty folder; choose another with -o, so that nothing is written over.")
    with _atomic_folder(output) as folder, counting(terminal, TimeRemainingColumn()) as progress:
        bar = progress.add_task("recordings", total=len(entries))
        if to == "lerobot":
            from app.recording.exchange.lerobot import dataset  # Others do not need its packages.

            paths = [entry.path for entry in entries]
            exported = dataset.export(paths, folder, fps=fps, rest_s=rest, done=lambda _: progress.advance(bar))
            told = f"{exported.episodes} episodes, {exported.steps} steps at {fps} a second."
            if not exported.is_placed:
                told += " Their cameras move or differ, so nothing in the dataset says where they are."
        else:
            told = _write_each(progress, bar, entries, folder, to, what)
    terminal.print(f"{output}: {told}")


@contextmanager
def _atomic_folder(output: Path) -> Generator[Path]:
    """A folder that takes its name when all is in it; nothing is left of one that fails."""
    try:
        goal = link_target(output)
    except OSError as error:
        raise unwritable(output, "-o", error) from None
    unfinished = path_beside(goal, ".unfinished")
    shutil.rmtree(unfinished, ignore_errors=True)
    make_folder(unfinished, "-o")
    try:
        yield unfinished
        if goal.exists():
            goal.rmdir()
        unfinished.rename(goal)
    finally:
        shutil.rmtree(unfinished, ignore_errors=True)


def _chosen(terminal: Console, entries: Sequence[Entry], labelled: str | None) -> Sequence[Entry]:
    for entry in entries:
        if entry.condition != "whole":
            terminal.print(f"Left out: {entry.state}")
    chosen = [it for it in entries if it.condition == "whole" and labelled in (None, it.said)]
    if not chosen:
        kind = f" labelled {labelled}" if labelled else ""
        raise UsageError(f"There is no whole recording{kind} among {len(entries)}; see `dipac recordings list`.")
    return chosen


def _write_each(progress: Progress, bar: TaskID, entries: Sequence[Entry], folder: Path, to: Format, what: What) -> str:
    """Arrays or clouds of each recording; returns what was written, in words. One that has none is left out."""
    counts, taken = list[int](), set[str]()
    for entry in entries:
        path = entry.path
        stem = next(name for name in numbered_names(path.stem) if name not in taken)
        try:
            if to == "npz":
                count = write_npz(path, folder / f"{stem}.npz", _what_is_compared(entry.task))
            else:
                count = write_ply(path, folder / stem, what)
        except RecordingError as error:
            progress.console.print(f"{path} is left out: {error}")
        else:
            counts.append(count)
            taken.add(stem)
        progress.advance(bar)
    if not counts:
        raise RecordingError(f"None of {len(entries)} recordings holds what {to} files are made of.")
    return f"{sum(counts)} {'pushes' if to == 'npz' else 'clouds'} of {len(counts)} recordings."


def _what_is_compared(task: str) -> What:
    """The clouds by which objects of a task are compared: of a liquid its surface does not say how much is where."""
    problem = TaskName.parse(task).problem
    return "particles" if problem in names() and load(problem).perception.standing else "surface"
