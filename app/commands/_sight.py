"""Perception settings from the command line."""

from dataclasses import replace
from pathlib import Path

from app.core.errors import UsageError
from app.core.system.probe import probe
from app.perception.mask.learned import Learned, load_segmenter
from app.tasks import Task


def seen_with(task: Task, segmenter: Path | None, *, depth: bool) -> Task:
    """The task, its object found by the network in the file `segmenter`, and with or without readings of depth.

    Raises UsageError where the file is no such network, and for a liquid without depth.
    """
    how = replace(task.perception, depth=depth)
    if how.standing and not depth:
        raise UsageError(f"--no-depth: the level of the liquid of {task.name} cannot be told from its outline.")
    if segmenter is not None:
        objects = 1 + (len(how.swimming.colours) if how.swimming else 0)
        how = replace(how, segmenter=load_tried_segmenter(segmenter, objects))
    return replace(task, perception=how)


def load_tried_segmenter(path: Path, objects: int) -> Learned:
    """`load_segmenter` of a file that a process of its own has loaded before.

    OpenCV ends the process at some damaged networks, as where a node names an input that is not there. Raises
    UsageError for these, too.
    """
    tried = probe(
        "from pathlib import Path; from app.perception.mask.learned import load_segmenter; "
        f"load_segmenter(Path({str(path)!r}), {objects})"
    )
    if tried.was_killed:
        raise UsageError(f"--segmenter {path} is damaged: OpenCV, which runs it, {tried.failure}; export it again.")
    return load_segmenter(path, objects)
