"""Tasks with another rope or another finger than their file's."""

from collections.abc import Mapping
from dataclasses import replace
from math import pi

from app.core.bounds import check_range
from app.core.errors import UsageError
from app.core.task_name import TaskName
from app.tasks.elements.base import Task

SIZES = {
    "length_m": (0.18, 0.80),
    "radius_m": (0.003, 0.016),
    "mass_kg": (0.003, 0.6),
    "finger_radius_m": (0.002, 0.030),
    "finger_half_width_m": (0.0, 0.045),
    "finger_yaw_rad": (-pi, pi),
}
"""Numbers that may be other ones, and their ranges: there a rod's time steps are as good as the nominal rope's, within
a factor of two (`tests/tasks/test_size_limits.py`)."""
_OF_FINGER = "finger_"


def resize(task: Task, sizes: Mapping[str, float]) -> Task:
    """The same with these sizes.

    Raises UsageError where the task has no rope or finger to change, or a size is unknown, ParameterError where it is
    out of its range.
    """
    if task.sized is None:
        raise UsageError(f"{task.name} has an object and a tool of its own; leave --object out, and sizes in brackets.")
    for name, value in sizes.items():
        if name not in SIZES:
            raise UsageError.unknown("size", name, SIZES)
        check_range(name, value, *SIZES[name])
    finger = {name: value for name, value in sizes.items() if name.startswith(_OF_FINGER)}
    rope = {name: value for name, value in sizes.items() if name not in finger}
    of_finger = {name.removeprefix(_OF_FINGER): value for name, value in finger.items()}
    made = task.sized(replace(task.rope, **rope), replace(task.finger, **of_finger))
    return replace(made, name=str(TaskName.of(task.name, sizes)))
