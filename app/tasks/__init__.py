"""One file a task, named as the task; and what the application asks of a task: plan, calibrate, warm up."""

import importlib
import pkgutil

from app.core.errors import UsageError
from app.tasks.base import Preset, Task
from app.tasks.jobs import calibrate, nominal_model, plan, update, warm_up_stage, warm_up_stages

__all__ = [
    "Preset",
    "Task",
    "calibrate",
    "load",
    "names",
    "nominal_model",
    "plan",
    "update",
    "warm_up_stage",
    "warm_up_stages",
]

_NOT_TASKS = ("aim", "asked", "base", "compiled", "correction", "curves", "doubted", "extended", "failures", "jobs")


def names() -> list[str]:
    """The names of all tasks: the files of this folder."""
    return sorted(module.name for module in pkgutil.iter_modules(__path__) if module.name not in _NOT_TASKS)


def load(name: str) -> Task:
    """The task in the file `name`.

    Raises UsageError with the known tasks where there is no such file, TypeError where the file defines no `TASK`.
    """
    if name not in names():
        raise UsageError.unknown("task", name, names())
    task = getattr(importlib.import_module(f"{__name__}.{name}"), "TASK", None)
    if not isinstance(task, Task) or task.name != name:
        raise TypeError(f"app/tasks/{name}.py must define TASK, a Task of the name {name!r}.")
    return task
