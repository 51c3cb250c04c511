"""Splits of a task's problems: the easy ones of its file, and the hard ones."""

from dataclasses import replace

from app.core.errors import UsageError
from app.core.task_name import Split, TaskName
from app.tasks.elements.base import Task


def with_problems(task: Task, split: Split) -> Task:
    """The same with the problems of this split, whose object and tool are the same.

    Raises UsageError where the task has no such split.
    """
    if split == "easy":
        return task
    if task.hard is None:
        raise UsageError(f"{task.name} has no hard problems; leave --problems out, and -hard in its name.")
    return replace(task.hard(task), name=str(replace(TaskName.parse(task.name), split=split)))
