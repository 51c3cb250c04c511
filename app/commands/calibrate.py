"""Estimate stiffness and friction from recorded motions.

They are written as a model file, with a plot of how it went. On ropes as rods the friction of the finger is estimated,
too, and where its tip is beside where the arm says.

Example: dipac calibrate recordings/FILE.mcap -o model.toml
"""

import shlex
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.table import Table
from rich.text import Text

from app.commands._arguments import Files
from app.commands._named import Dynamics, full_name
from app.commands._preflight import check_writable
from app.core.errors import RecordingError, UsageError
from app.core.geometry.object_description import recorded_object
from app.core.messages import Model, Parameter, Transition
from app.core.task_name import recorded_name
from app.evaluation.progress import draw_trials
from app.evaluation.scores import MM2
from app.jobs.worker_api import calibration, check_model, ends_of_ranges, nominal_model
from app.recording.exchange.model_file import load_model, save_model
from app.recording.format.digests import check_distinct, digest
from app.recording.library.recording_index import counted_once
from app.recording.read.reader import read_episode, read_transitions
from app.tasks import load
from app.tasks.elements.base import Task


def calibrate(
    recordings: Files,
    /,
    *,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], help="the model file to write")] = Path("model.toml"),
    start: Annotated[Path | None, tyro.conf.arg(help="a model.toml to start from instead of the nominal model")] = None,
    dynamics: Annotated[
        Dynamics | None,
        tyro.conf.arg(help="rods, for ropes, or mpm, material points; the task's own where none is named"),
    ] = None,
) -> None:
    """All recordings must be of one task; each push in them is one transition."""
    terminal = Console(highlight=False)
    if not recordings:
        raise UsageError("Name at least one recording: dipac calibrate recordings/FILE.mcap -o model.toml")
    check_writable(output, "-o")
    named = _task_of(recordings)
    task = load(full_name(named, dynamics=dynamics, model=start))
    if task.recorded_name != named:
        raise UsageError(
            f"{start} is a model of {task.recorded_name}, not of the recordings' {named}; start from another."
        )
    paths = _distinct_recordings(recordings)
    transitions = _transitions_of(paths)
    preset = _preset_for(task, transitions)
    fitting = f"{', '.join(task.calibrated)} to {len(transitions)} transitions of {len(paths)} recordings"
    terminal.print(Text(f"Fitting {fitting}; that takes minutes."), soft_wrap=True)
    with terminal.status("loading the simulator"):
        old = _start_model(start, task) if start else nominal_model(task.name, _priors(paths))
    with terminal.status(f"fitting {fitting}"):
        found = calibration(task.name, preset, transitions, old)
    new, picture = found.model, output.with_suffix(".svg")
    notes = ends_of_ranges(new)
    save_model(output, new, notes=notes)
    draw_trials(found, picture)
    terminal.print(_table(found.names, old, new, notes))
    for name, note in notes.items():
        terminal.print(Text(f"{name} is {note}: no measurement, and the truth may lie beyond it."), soft_wrap=True)
    terminal.print(
        Text(
            f"One-step Chamfer distance {MM2 * found.trials[0].loss_m2:.4g} mm^2 at the start, now "
            f"{MM2 * new.loss_m2:.4g} mm^2. "
            f"Written to {output}, how it went to {picture}; use it with "
            f"`dipac run {shlex.quote(task.recorded_name)} --model {output}`."
        ),
        soft_wrap=True,
    )


def _start_model(path: Path, task: Task) -> Model:
    """The model in the file, fit to start from."""
    model = load_model(path, task=task.name, time_s=0.0)
    check_model(model)
    return model


def _priors(recordings: Sequence[Path]) -> tuple[Parameter, ...]:
    """Priors of the first recording that describes its object."""
    found = (recorded_object(read_episode(path).config) for path in recordings)
    return next((description.priors for description in found if description is not None), ())


def _task_of(recordings: tuple[Path, ...]) -> str:
    tasks = {path: recorded_name(read_episode(path).task) for path in recordings}
    if len(set(tasks.values())) > 1:
        listed = ", ".join(f"{path}: {task}" for path, task in tasks.items())
        raise UsageError(f"The recordings are of different tasks ({listed}); calibrate one task at a time.")
    return next(iter(tasks.values()))


def _distinct_recordings(recordings: tuple[Path, ...]) -> list[Path]:
    """Each recording once. Raises UsageError where one is there under several names."""
    paths = list(dict.fromkeys(counted_once(recordings)))
    check_distinct({path: digest(path) for path in paths})
    return paths


def _transitions_of(paths: list[Path]) -> list[Transition]:
    transitions = [transition for path in paths for transition in read_transitions(path)]
    if not transitions:
        raise RecordingError("The recordings hold no finished push to learn from; record at least one.")
    return transitions


def _preset_for(task: Task, transitions: list[Transition]) -> str:
    """The preset that plans with as many particles as were recorded."""
    counts = {count for transition in transitions for count in (len(transition.before), len(transition.after))}
    for name, preset in task.presets.items():
        if counts == {preset.particle_count}:
            return name
    raise RecordingError(
        f"The recordings hold clouds of {sorted(counts)} particles; they must all have those of one preset of "
        f"{task.name}: {', '.join(f'{name} {preset.particle_count}' for name, preset in task.presets.items())}."
    )


def _table(names: Sequence[str], old: Model, new: Model, notes: Mapping[str, str]) -> Table:
    table = Table("parameter", "unit", "start", "fitted", "90 % interval", "")
    began = {parameter.name: parameter.value for parameter in (*old.parameters, *old.apparatus)}
    for parameter in (*new.parameters, *new.apparatus):
        if parameter.name in names:
            table.add_row(
                parameter.name,
                Text(parameter.unit),
                f"{began.get(parameter.name, 0.0):.4g}",
                f"{parameter.value:.4g}",
                f"{parameter.low:.4g} to {parameter.high:.4g}",
                notes.get(parameter.name, ""),
            )
    return table
