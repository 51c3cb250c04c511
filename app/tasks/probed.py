"""Experiments on a task: what its recordings say so far, and the next push that tells most about what is missing.

Plain functions of picklable arguments, to be run in worker processes, as `jobs`.
"""

from __future__ import annotations

from typing import TYPE_CHECKING

import numpy as np

from app.arm.gate import check_motion, way
from app.arm.path import raised
from app.config import Site
from app.core.errors import MotionRefused, UsageError
from app.core.stage import Rope

if TYPE_CHECKING:
    from collections.abc import Sequence

    from app.core.motion import Motion
    from app.core.track import Track
    from app.discovery.probe import Belief
    from app.discovery.probe_pushes import Probe, Scene
    from app.discovery.study import Push, Study, View
    from app.discovery.subject import Subject
    from app.policy.strokes import Plan
    from app.tasks.base import Task


def probed_subject(task: Task) -> Subject:
    """The simulator that experiments are about.

    Raises UsageError for what is not a rope that is pushed and simulated as a rod: candidates are simulated by the
    thousand, and of other objects that takes minutes a push.
    """
    from app.planner.actions import Pushes
    from app.tasks.doubted import subject_of

    if not isinstance(task.stage.body, Rope) or not isinstance(task.actions, Pushes):
        raise UsageError(f"dipac probe pushes ropes so far, and {task.problem} is another task; try rope_push.")
    if task.dynamics != "rods":
        raise UsageError(f"dipac probe simulates ropes as rods; leave out --dynamics {task.dynamics}.")
    return subject_of(task)


def belief(task: str, study: Study | None = None) -> Belief:
    """What a study says; without one, what is believed before any push. Takes up to a minute."""
    from app.discovery.probe import believed, first_belief
    from app.tasks import load

    subject = probed_subject(load(task))
    return first_belief(subject) if study is None else believed(study, subject)


def next_probe(
    task: str,
    held: Belief,
    seen: View,
    episode: int,
    made: Sequence[Push],
    plan: Plan,
    seed: int,
    site: Site | None = None,
) -> Probe:
    """The next push for the object as it is `seen`. Raises PlanningError where none may be made."""
    from app.discovery.probe_pushes import chosen
    from app.tasks import load

    data = load(task)
    return chosen(probed_subject(data), held, scene(data, seen, episode, made, plan, site or Site()), seed=seed)


def scene(task: Task, seen: View, episode: int, made: Sequence[Push], plan: Plan, site: Site) -> Scene:
    """What a push is chosen for."""
    from app.discovery.probe_pushes import Scene

    return Scene(
        task=task.recorded,
        seen=seen,
        episode=episode,
        made=tuple(made),
        plan=plan,
        height_m=task.finger.push_height_m,
        allowed=lambda track: refusal(probe_motion(task, track, site), site) == "",
        core_m=task.finger.half_m,
    )


def probe_motion(task: Task, track: Track, site: Site) -> Motion:
    """A chosen push as a motion that the gate can check."""
    from app.planner.actions import Pushes
    from app.tasks.asked import motion_of

    assert isinstance(task.actions, Pushes)
    return motion_of(track, task.actions, site)


def refusal(motion: Motion, site: Site) -> str:
    """Why the arm's own process would not make a motion that begins above its first position; empty where it would."""
    try:
        check_motion(motion, motion.digest(), site)
        way(raised(np.asarray(motion.poses[0]), site), motion, site)
    except MotionRefused as refused:
        return str(refused)
    return ""
