"""Studies of motions without images: what cameras would see of each is drawn."""

from collections.abc import Callable, Iterable
from dataclasses import replace
from typing import TypeAlias

import numpy as np

from app.core.task_name import recorded_name
from app.discovery.dataset.study import ProjectionView, Push, Study
from app.rig.simulated.push_session import PushSample, StampedSnapshot
from app.tasks.elements.base import Task
from bench.hidden.ropes import bare_table, seen_tip

View: TypeAlias = Callable[[StampedSnapshot], ProjectionView]
"""The object as cameras and their reconstruction show it."""


def study_of(task: Task, takes: Iterable[PushSample], view: View, rng: np.random.Generator) -> Study:
    """Motions as discovery reads them, with the tool in the view during each, and the bare table of each episode."""
    pushes = tuple(_push_of(take, view, rng) for take in takes)
    tables = {each.episode: bare_table(rng) for each in pushes}
    return Study(task=recorded_name(task.name), pushes=pushes, tables=tables)


def _push_of(take: PushSample, view: View, rng: np.random.Generator) -> Push:
    before, during, after = (view(look) for look in (take.before, take.during, take.after))
    return Push(
        episode=take.episode,
        before=before,
        during=(replace(during, finger=seen_tip(take.during.snapshot.tip, rng)),),
        after=after,
        command=take.command,
        measured=take.measured,
    )
