"""Tasks, one a file named as the task."""

import importlib
import pkgutil
from dataclasses import replace
from functools import cache
from pathlib import Path

from app.core.errors import UsageError
from app.core.task_name import TaskName
from app.tasks.elements.base import Preset, Task
from app.tasks.elements.sizes import resize
from app.tasks.elements.splits import with_problems

__all__ = ["Preset", "Task", "add", "load", "name_with_dynamics", "names"]

_ADDED: dict[str, Task] = {}
"""Tasks of the program that uses this package, besides the files of the folder."""


def add(task: Task) -> Task:
    """Make a task known by its name in this process, for a program that defines one outside of this folder.

    Other processes do not know it: `dipac run` needs a file here. Raises UsageError where another task has that name,
    as what is compiled for a task is kept by its name.
    """
    if task.problem != task.name:
        raise UsageError(f"{task.name} says a split, sizes or dynamics; add the task without them, as {task.problem}.")
    if task.name in names() or _ADDED.setdefault(task.name, task) is not task:
        raise UsageError(f"There is a task {task.name} already; give the new one another name.")
    return task


@cache
def names() -> list[str]:
    """The names of all tasks: those of the files in this folder, which are not imported for it."""
    return sorted(module.name for module in pkgutil.iter_modules(__path__) if not module.ispkg)


def load(name: str) -> Task:
    """The task of that name, which may say a split, sizes and dynamics (`TaskName`); one and the same each time.

    Raises UsageError with the known tasks where there is no such file, and with the file, the field and the value where
    what it defines is no task: a field is missing or unknown, a number impossible, the name another one.
    """
    wanted = TaskName.parse(name)
    task = _find_task(wanted.problem)
    return task if str(wanted) == task.name else _other(wanted)


def name_with_dynamics(task: str, dynamics: str | None = None) -> str:
    """The full name of `task` with these dynamics instead of any that it says, and with its own where None are given.

    Raises UsageError where it has no such dynamics.
    """
    known = load(task)
    return load(str(replace(TaskName.parse(task), dynamics=dynamics or known.own_dynamics))).name


def _find_task(name: str) -> Task:
    return _ADDED.get(name) or _of_file(name)


def _of_file(name: str) -> Task:
    if name not in names():
        raise UsageError.unknown("task", name, names())
    module = f"{__name__}.{name}"
    file = Path(__file__).with_name(f"{name}.py")
    try:
        task = importlib.import_module(module).TASK
    except (TypeError, UsageError) as error:
        raise UsageError(f"{file} defines no task: {error}") from error
    if task.name != name:
        raise UsageError(f"{file} defines a task of the name {task.name!r}; it must be that of the file, {name!r}.")
    return task


@cache
def _other(name: TaskName) -> Task:
    """The task with another split, other sizes or dynamics; cached, so that compiled code is found again."""
    task = _find_task(name.problem)
    if name.sizes:
        task = resize(task, dict(name.sizes))
    return with_problems(task, name.split).with_dynamics(name.dynamics)
