"""Demonstrations for imitation learning: each transition with its goal."""

from dataclasses import dataclass
from pathlib import Path
from typing import final

import numpy as np

from app.core.errors import RecordingError
from app.core.messages import Episode, Goal, Transition
from app.core.types import Points
from app.recording.format import digests
from app.recording.read.reader import read_messages


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Demonstrations:
    """Demonstrations of `task` in a recording (SHA-256 `digest`): transitions in order, and the goal of each [m]."""

    task: str
    digest: str
    transitions: tuple[Transition, ...]
    goals: tuple[Points, ...]


def read_taught(path: Path) -> Demonstrations:
    """Demonstrations in the file. Raises as `read_messages`, and RecordingError where no action has a goal."""
    task, goal = "", np.zeros((0, 3), np.float32)
    transitions, goals = list[Transition](), list[Points]()
    for message in read_messages(path, [Episode, Goal, Transition]):
        match message:
            case Episode():
                task = message.task
            case Goal():
                goal = message.positions
            case Transition() if len(goal):
                transitions.append(message)
                goals.append(goal)
            case _:
                pass
    if not transitions:
        raise RecordingError(f"{path} shows nothing that was done towards a goal; leave it out, or record it again.")
    return Demonstrations(task=task, digest=digests.digest(path), transitions=tuple(transitions), goals=tuple(goals))
