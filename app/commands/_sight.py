"""Perception settings from the command line."""

from dataclasses import replace
from pathlib import Path

from app.core.errors import UsageError
from app.perception.mask.learned import load_segmenter
from app.tasks import Task


def seen_with(task: Task, segmenter: Path | None, *, depth: bool) -> Task:
    """The task, its object found by the network in the file `segmenter`, and with or without readings of depth.

    Raises UsageError where the file is no such network, and for a liquid without depth.
    """
    how = replace(task.perception, depth=depth)
    if how.standing and not depth:
        raise UsageError(f"--no-depth: the level of the liquid of {task.name} cannot be told from its outline.")
    if segmenter is not None:
        how = replace(how, segmenter=load_segmenter(segmenter, 1 + (len(how.swimming.colours) if how.swimming else 0)))
    return replace(task, perception=how)
