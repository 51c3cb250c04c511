"""Perception settings from the command line."""

import signal
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from typing import Final

from app.core.errors import UsageError
from app.perception.mask.learned import Learned, load_segmenter
from app.tasks import Task

_TRIAL: Final = (
    "import pathlib, sys; from app.perception.mask.learned import load_segmenter; "
    "load_segmenter(pathlib.Path(sys.argv[1]), int(sys.argv[2]))"
)
_TRIAL_S: Final = 60.0


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
    order = [sys.executable, "-c", _TRIAL, str(path), str(objects)]
    advice = "export it again"
    try:
        ended = subprocess.run(order, capture_output=True, timeout=_TRIAL_S).returncode  # noqa: S603 - our own program
    except subprocess.TimeoutExpired:
        raise UsageError(f"--segmenter {path} takes OpenCV more than {_TRIAL_S:.0f} s to load; {advice}.") from None
    if ended < 0:
        name = signal.Signals(-ended).name
        raise UsageError(f"--segmenter {path} is damaged: OpenCV, which runs it, crashes ({name}); {advice}.")
    return load_segmenter(path, objects)
