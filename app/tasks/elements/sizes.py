"""Tasks with another rope, another finger or other beans than their file's."""

from collections.abc import Callable, Mapping
from dataclasses import replace
from math import pi

from app.core.bounds import check_range
from app.core.errors import UsageError
from app.core.geometry.scene_description import Beans
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
BEAN_SIZES = {"count": (20.0, 80.0), "mass_kg": (0.01, 0.2)}
"""Number of beans, and the mass of all, that may be other ones, and their ranges."""


def resize(task: Task, sizes: Mapping[str, float]) -> Task:
    """The same with these sizes.

    Raises UsageError where the task has no rope, finger or beans to change, or a size is unknown, ParameterError where
    it is out of its range.
    """
    if task.with_beans is not None:
        return _with_beans(task, sizes, task.with_beans)
    if task.sized is None:
        raise UsageError(f"{task.name} has an object and a tool of its own; leave --object out, and sizes in brackets.")
    _check(sizes, SIZES)
    finger = {name: value for name, value in sizes.items() if name.startswith(_OF_FINGER)}
    rope = {name: value for name, value in sizes.items() if name not in finger}
    of_finger = {name.removeprefix(_OF_FINGER): value for name, value in finger.items()}
    made = task.sized(replace(task.rope, **rope), replace(task.finger, **of_finger))
    return replace(made, name=str(TaskName.of(task.name, sizes)))


def _with_beans(task: Task, sizes: Mapping[str, float], with_beans: Callable[[Beans], Task]) -> Task:
    """The task with so many beans of that mass in all; the mass of one stays where none is given."""
    _check(sizes, BEAN_SIZES)
    own = task.stage.body
    assert isinstance(own, Beans)
    count = round(sizes.get("count", own.count))
    if count != sizes.get("count", count):
        raise UsageError(f"count={sizes['count']:g} is no whole number of beans.")
    mass_kg = sizes.get("mass_kg", own.mass_kg * count / own.count)
    return replace(with_beans(replace(own, count=count, mass_kg=mass_kg)), name=str(TaskName.of(task.name, sizes)))


def _check(sizes: Mapping[str, float], known: Mapping[str, tuple[float, float]]) -> None:
    for name, value in sizes.items():
        if name not in known:
            raise UsageError.unknown("size", name, known)
        check_range(name, value, *known[name])
