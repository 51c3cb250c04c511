"""Interface of tasks to policy learning: training setup and examples of a task, and its learned policies."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from app.core.errors import RecordingError, UsageError
from app.core.messages import Model, Transition
from app.core.types import Points
from app.jobs.jit_cache import action_simulator, needs, phi_of
from app.policy.learned.base import LearnedPolicy, Lessons, TrainingSimulator
from app.policy.learned.examples import Examples
from app.policy.learned.file import load_policy
from app.tasks.elements.base import Task


def lessons(task: Task, world: TrainingSimulator | None = None) -> Lessons:
    """Training setup of the task's policies."""
    return Lessons(space=task.actions, symmetry=task.symmetry, views=task.views, world=world)


SHIPPED = Path("shipped")
"""Named instead of a file: the policy that comes with the program, of the folder `app/jobs/shipped`."""
_SHIPPED = Path(__file__).parent / SHIPPED


def load_learned(path: Path, task: Task, kind: str | None = None) -> LearnedPolicy:
    """The task's policy in that file or folder, or the one that is `SHIPPED`.

    Raises UsageError and RecordingError as `load_policy`, and UsageError where it is of another `kind`.
    """
    where = shipped_policy_file(task.problem) if path == SHIPPED else path
    policy, origin = load_policy(where, task=task.problem, how=lessons(task))
    if kind is not None and origin.kind != kind:
        raise UsageError(f"{where} holds a policy of the kind {origin.kind}, not {kind}; move it, or train one.")
    return policy


def shipped_policy_file(task: str) -> Path:
    """The file of the policy of that task which comes with the program."""
    return _SHIPPED / f"{task}.safetensors"


def simulator(task: Task, model: Model, particle_count: int) -> TrainingSimulator:
    """The task's simulator of so many particles, for learners that learn by simulation."""
    phi = phi_of(model)
    advance = action_simulator(task.name, particle_count, *needs(task.name, phi))
    return TrainingSimulator(advance=advance, begin=task.initial_state, phi=tuple(map(float, phi)))


def examples(task: Task, shown: Sequence[tuple[Sequence[Transition], Sequence[Points]]]) -> Examples:
    """Examples from demonstrations, each of transitions and the goal of each of them [m].

    Raises RecordingError if their numbers of particles differ.
    """
    rows = [
        (np.asarray(transition.before, np.float32), np.asarray(goal, np.float32), *_done(task, transition), episode)
        for episode, (transitions, goals) in enumerate(shown)
        for transition, goal in zip(transitions, goals, strict=True)
    ]
    counts = sorted({count for before, goal, *_ in rows for count in (len(before), len(goal))})
    if len(counts) > 1:
        raise RecordingError(
            f"The recordings hold clouds and goals of {counts} particles; take those of one preset of {task.name}."
        )
    return Examples(*(np.stack(column) for column in zip(*rows, strict=True)))


def _done(task: Task, transition: Transition) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Tool pose, the action that was made, and the object after it."""
    poses = transition.executed.tool
    after = np.asarray(transition.after, np.float32)
    return np.asarray(poses[0], np.float32), task.actions.measured_action(poses), after
