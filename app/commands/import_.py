"""Make a recording of what other programs measured.

Example: dipac import BAG.mcap --task rope_push -o pushes.mcap
"""

from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Annotated, Any, Final

import tyro
from rich.console import Console
from rich.progress import TimeRemainingColumn

from app.cells.cell_file import load_cell, table
from app.commands._imported import imported_messages, plain_lines
from app.commands._measured_setup import is_of_rope, measured_setup
from app.commands._preflight import check_writable, unwritable
from app.commands._progress import counting
from app.core.errors import RecordingError, UsageError
from app.core.geometry.object_description import SIZES
from app.core.geometry.scene_description import Rope
from app.core.geometry.table_place import AT_BASE
from app.core.messages import Episode, Message
from app.core.system.disk import replacement
from app.core.task_name import TaskName
from app.recording.exchange.foreign_file import is_foreign, open_foreign
from app.recording.exchange.npz_import import Plain, read_plain
from app.recording.exchange.streams.measured_episode import ForeignSource
from app.recording.exchange.streams.stream_map import StreamMap, read_stream_map
from app.recording.format import digests
from app.recording.format.clock_offset import Epoch
from app.recording.write.file import EpisodeFile
from app.services.foreign_pushes import find_pushes
from app.tasks import load
from app.tasks.elements.base import Task

_PERCENT: Final = 100


def import_(
    file: Annotated[
        tyro.conf.Positional[Path],
        tyro.conf.arg(metavar="FILE", help="arrays (.npz), a bag, or the folder of a bag, a dataset or images"),
    ],
    /,
    *,
    output: Annotated[
        Path | None, tyro.conf.arg(aliases=["-o"], help="the recording to write, a new .mcap file")
    ] = None,
    task: Annotated[str | None, tyro.conf.arg(help="the task, where the file does not name it")] = None,
    cell: Annotated[Path | None, tyro.conf.arg(help="a real cell's TOML file that says where its table is")] = None,
    topics: Annotated[Path | None, tyro.conf.arg(help="a TOML file with the mapping, as --show prints it")] = None,
    show: Annotated[bool, tyro.conf.arg(help="print what is in the file, and write nothing")] = False,
) -> None:
    """Check everything, then write; where something is wrong, nothing is written.

    Read are arrays (.npz), bags of ROS 2 (.mcap, .db3 or their folder), LeRobot datasets, and folders of images with a
    poses.csv. docs/importing.md says what each needs; of all but arrays, what is in them and which of it is taken for
    what is printed first. --show prints it as a file for --topics, to be edited.

    Its places are in the frame of the arm's base; recordings are in that of the table, which is the same where --cell
    does not say otherwise.
    """
    terminal = Console(highlight=False, soft_wrap=True, markup=False, emoji=False)
    if show:
        _show(terminal, file, topics)
        return
    if output is None:
        raise UsageError("Name the recording to write with -o REC.mcap; --show alone prints what is in the file.")
    _check_output(output)
    place = AT_BASE if cell is None else table(load_cell(cell))
    if not is_foreign(file):
        _require_no_topics(file, topics)
        plain = read_plain(file).in_table(place)
        known = load(_task_name(plain.about, task, file))
        _import_plain(terminal, plain, known, output)
        return
    with open_foreign(file) as source:
        streams = source.guess() if topics is None else read_stream_map(topics)
        _print_mapping(terminal, source, streams)
        known = load(_task_name(streams.about, task, file))
        episodes = source.episodes(streams)
        with counting(terminal, TimeRemainingColumn()) as progress:
            bar = progress.add_task("looking", total=_PERCENT)
            found = find_pushes(
                episodes,
                streams,
                known,
                place=place,
                done=lambda share: progress.update(bar, completed=round(_PERCENT * share)),
            )
        _import_plain(terminal, found.plain, known, output, found.notes, began_ns=episodes[0].began_ns)


def _import_plain(
    terminal: Console, plain: Plain, known: Task, output: Path, remarks: Sequence[str] = (), *, began_ns: int = 0
) -> None:
    """Write the recording of data in the table's frame, and say what it is of."""
    setup, notes = None, list[str]()
    if is_of_rope(known):
        plain, known, setup = measured_setup(plain, known)
        notes = [*setup.words, *setup.notes, *(f"{flaw} No cause will be named." for flaw in setup.flaws)]
    elif isinstance(known.stage.body, Rope):
        known, notes = _resize_task(known, plain)
    else:
        notes = _unused_sizes(known, plain)
    _write(output, imported_messages(plain, known, setup), began_ns)
    pushes = sum(len(episode.pushes) for episode in plain.episodes)
    terminal.print(f"{output}: {pushes} pushes in {len(plain.episodes)} episodes of {known.recorded_name}.")
    for note in (*remarks, *notes):
        terminal.print(note)


def _check_output(output: Path) -> None:
    """Raises UsageError where no recording can be written there."""
    if output.suffix != ".mcap":
        name = output.name.strip("-") or "data"
        raise UsageError(f"{output} must end in .mcap, as recordings do; write -o {name}.mcap.")
    if output.exists():
        raise UsageError(f"{output} exists; choose another place with -o, so that no recording is lost.")
    check_writable(output, "-o")


def _require_no_topics(file: Path, topics: Path | None) -> None:
    if topics is not None:
        raise UsageError(f"--topics is for bags, datasets and folders; the arrays of {file} have names of their own.")


def _show(terminal: Console, file: Path, topics: Path | None) -> None:
    """Print what is in the file; of what needs a mapping, as a TOML document."""
    if not is_foreign(file):
        _require_no_topics(file, topics)
        for line in plain_lines(file, read_plain(file)):
            terminal.print(line)
        return
    with open_foreign(file) as source:
        streams = source.guess() if topics is None else read_stream_map(topics)
        for line in source.stream_list.lines():
            terminal.print(f"# {line}")
        terminal.print(f"\n{streams.toml()}".rstrip())


def _print_mapping(terminal: Console, source: ForeignSource, streams: StreamMap) -> None:
    for line in source.stream_list.lines():
        terminal.print(line)
    terminal.print(f"\nTaken as (--show prints this as a file for --topics):\n{streams.toml()}")


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
    return load(str(TaskName.of(task.problem, sizes, split=TaskName.parse(task.name).split))), notes


def _unused_sizes(task: Task, plain: Plain) -> list[str]:
    """Sizes that the file gives, and that a task has of its own, in words."""
    said = [f"{part}.{name}" for part in ("object", "tool") for name in plain.about.get(part, {})]
    if not said:
        return []
    return [f"The task {task.name} has an object and a tool of its own: {', '.join(said)} in about are not used."]


def _task_name(about: Mapping[str, Any], given: str | None, file: Path) -> str:
    named: Any = about.get("task")
    if named is not None and not isinstance(named, str):
        raise RecordingError(f"{file}: about says that the task is {named!r}; give its name as a string.")
    if named is not None and given is not None and named != given:
        raise UsageError(f"--task {given} contradicts {file}, whose about says {named!r}; leave --task out.")
    name = given if given is not None else named
    if name is None:
        raise UsageError(f'{file} names no task; give one with --task, or in about as {{"task": "rope_push"}}.')
    return name


def _write(path: Path, messages: Iterable[Message], began_ns: int) -> None:
    """A whole recording at `path`, or none: it gets its name when it is complete.

    `began_ns`: time 0 of the messages, in nanoseconds since 1970; 0 where nobody says it.
    """
    remaining = iter(messages)
    first = next(remaining)
    assert isinstance(first, Episode)
    try:
        with replacement(path) as unfinished:
            file = EpisodeFile(unfinished, first, epoch=Epoch(offset_ns=began_ns) if began_ns > 0 else None)
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
