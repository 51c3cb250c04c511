"""The full name of the task that a command line asks for: its object, its tool, and how that object is simulated."""

from collections.abc import Mapping
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Literal, TypeAlias

from app.core.errors import ParameterError, UsageError
from app.core.geometry.object_description import ObjectDescription
from app.core.task_name import Split, TaskName
from app.recording.exchange.model_file import task_of
from app.recording.exchange.object_file import load_object
from app.tasks import load, name_with_dynamics, names
from app.tasks.elements.descriptions import check_object

Dynamics: TypeAlias = Literal["rods", "mpm"]


def full_name(
    task: str,
    *,
    dynamics: Dynamics | None,
    problems: Split | None = None,
    sizes: Mapping[str, float] = MappingProxyType({}),
    model: Path | None = None,
) -> str:
    """Full name of `task` with these problems, sizes and dynamics.

    What neither the name nor the caller specifies is that of `model` if it is of the same task, else the task's own;
    problems are easy ones then. Raises UsageError for an unknown task, size or dynamics, where the task has no such
    problems, and if the name contradicts `dynamics` or `problems`.
    """
    load(task)
    name = TaskName.parse(task)
    engine: str | None = name.dynamics if "@" in task else None
    if None not in (engine, dynamics) and engine != dynamics:
        raise UsageError(f"{task} contradicts --dynamics {dynamics}; leave one of them out.")
    if problems == "easy" != name.split:
        raise UsageError(f"{task} contradicts --problems {problems}; leave one of them out.")
    split = problems or name.split
    engine, own = engine or dynamics, dict(name.sizes) | dict(sizes)
    if model is not None:
        its = TaskName.parse(task_of(model))
        if its.problem == name.problem:
            engine, own = engine or its.dynamics, own or dict(its.sizes)
    return name_with_dynamics(str(TaskName.of(name.problem, own, split=split)), engine)


def read_description(path: Path, task: str) -> ObjectDescription:
    """The object that a file describes, for the task of this full name with the file's sizes.

    Raises UsageError where it cannot be read, is of another kind, or has sizes that this task cannot have.
    """
    description = load_object(path)
    check_description(description, task, f"{path}: ")
    return description


def check_description(description: ObjectDescription, task: str, whose: str) -> None:
    """Raises UsageError, which begins with `whose`, where the object is none of the task of this full name."""
    try:
        problem = load(TaskName.parse(task).problem)
        check_object(problem, replace(description, priors=()), map(load, names()))
        check_object(load(full_name(task, dynamics=None, sizes=description.sizes)), description, ())
    except ParameterError as error:
        raise ParameterError(f"{whose}{error}") from None
    except UsageError as error:
        raise UsageError(f"{whose}{error}") from None
