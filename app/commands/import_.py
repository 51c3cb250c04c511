"""Make a recording of data that were measured with other programs (arrays in an .npz file)."""

from collections.abc import Iterable
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from app.cells.cell_file import load_cell, table
from app.commands._imported import imported_messages
from app.commands._measured_setup import is_of_rope, measured_setup
from app.commands._preflight import check_writable, unwritable
from app.core.errors import RecordingError, UsageError
from app.core.geometry.scene_description import Rope
from app.core.messages import Episode, Message
from app.core.system.disk import replacement
from app.core.task_name import TaskName
from app.recording.exchange.npz_import import Plain, read_plain
from app.recording.format import digests
from app.recording.write.file import EpisodeFile
from app.tasks import load
from app.tasks.elements.base import Task
from app.tasks.elements.sizes import SIZES


def import_(
    file: tyro.conf.Positional[Path],
    /,
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], help="the recording to write, a new .mcap file")],
    task: Annotated[str | None, tyro.conf.arg(help="the task, where the file does not name it")] = None,
    cell: Annotated[Path | None, tyro.conf.arg(help="a real cell's TOML file that says where its table is")] = None,
) -> None:
    """Check everything, then write; where something is wrong, nothing is written.

    docs/recording-format.md says what the file holds, with a script that makes one. Its places are in the frame of the
    arm's base; recordings are in that of the table, which is the same where --cell does not say otherwise.
    """
    terminal = Console(highlight=False, soft_wrap=True, markup=False, emoji=False)
    if output.suffix != ".mcap":
        name = output.name.strip("-") or "data"
        raise UsageError(f"{output} must end in .mcap, as recordings do; write -o {name}.mcap.")
    if output.exists():
        raise UsageError(f"{output} exists; choose another place with -o, so that no recording is lost.")
    check_writable(output, "-o")
    plain = read_plain(file)
    if cell is not None:
        plain = plain.in_table(table(load_cell(cell)))
    known, setup, notes = load(_task_name(plain, task, file)), None, list[str]()
    if is_of_rope(known):
        plain, known, setup = measured_setup(plain, known)
        notes = [*setup.words, *setup.notes, *(f"{flaw} No cause will be named." for flaw in setup.flaws)]
    elif isinstance(known.stage.body, Rope):
        known, notes = _resize_task(known, plain)
    else:
        notes = _unused_sizes(known, plain)
    count = known.preset("cpu").particle_count
    _write(output, imported_messages(plain, known.recorded_name, count, setup))
    pushes = sum(len(episode.pushes) for episode in plain.episodes)
    terminal.print(f"{output}: {pushes} pushes in {len(plain.episodes)} episodes of {known.recorded_name}.")
    for note in notes:
        terminal.print(note)


def _resize_task(task: Task, plain: Plain) -> tuple[Task, list[str]]:
    """The task with an object and a tool of the file's sizes, and those of the sizes that it cannot have."""
    said = {
        "length_m": (plain.about.get("object", {}).get("length_m"), task.rope.length_m),
        "radius_m": (plain.about.get("object", {}).get("radius_m"), task.rope.radius_m),
        "mass_kg": (plain.about.get("object", {}).get("mass_kg"), task.rope.mass_kg),
        "finger_radius_m": (plain.about.get("tool", {}).get("radius_m"), task.finger.radius_m),
        "finger_half_width_m": (plain.about.get("tool", {}).get("half_width_m"), task.finger.half_width_m),
        "finger_yaw_rad": (plain.about.get("tool", {}).get("yaw_rad"), task.finger.yaw_rad),
    }
    sizes, notes = dict(TaskName.parse(task.name).sizes), list[str]()
    for name, (value, own) in said.items():
        if value is None or value == own:
            continue
        low, high = SIZES[name]
        if task.sized is not None and low <= value <= high:
            sizes[name] = float(value)
        else:
            can = f"from {low:g} to {high:g}" if task.sized is not None else "only that"
            notes.append(f"about says {name} = {value:g}; the task {task.problem} has {own:g}, and can have {can}.")
    return load(str(TaskName.of(task.problem, sizes))), notes


def _unused_sizes(task: Task, plain: Plain) -> list[str]:
    """Sizes that the file gives, and that a task has of its own, in words."""
    said = [f"{part}.{name}" for part in ("object", "tool") for name in plain.about.get(part, {})]
    if not said:
        return []
    return [f"The task {task.name} has an object and a tool of its own: {', '.join(said)} in about are not used."]


def _task_name(plain: Plain, given: str | None, file: Path) -> str:
    named = plain.about.get("task")
    if named is not None and not isinstance(named, str):
        raise RecordingError(f"{file}: about says that the task is {named!r}; give its name as a string.")
    if named is not None and given is not None and named != given:
        raise UsageError(f"--task {given} contradicts {file}, whose about says {named!r}; leave --task out.")
    name = given if given is not None else named
    if name is None:
        raise UsageError(f'{file} names no task; give one with --task, or in about as {{"task": "rope_push"}}.')
    return name


def _write(path: Path, messages: Iterable[Message]) -> None:
    """A whole recording at `path`, or none: it gets its name when it is complete."""
    remaining = iter(messages)
    first = next(remaining)
    assert isinstance(first, Episode)
    try:
        with replacement(path) as unfinished:
            file = EpisodeFile(unfinished, first)
            file.write(first, now_s=first.time_s)
            for message in remaining:
                file.write(message, now_s=message.time_s)
            file.close()
        digests.note(path)
    except (OSError, RuntimeError) as error:
        raise _unwritable(path, error) from error


def _unwritable(path: Path, error: OSError | RuntimeError) -> UsageError:
    if isinstance(error, OSError):
        return unwritable(path, "-o", error)
    return UsageError(f"Cannot write {path}: {error}; choose another place with -o.")
