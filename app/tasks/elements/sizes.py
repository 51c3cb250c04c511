"""Tasks with another rope, finger or cloth, other beans or another liquid than their file's."""

from collections.abc import Mapping
from dataclasses import replace

from app.core.bounds import check_range
from app.core.errors import UsageError
from app.core.geometry.object_description import BEAN_SIZES, CLOTH_SIZES, LIQUID_SIZES, SIZES
from app.core.geometry.scene_description import Beans, Body, Cloth, Liquid
from app.core.task_name import TaskName
from app.tasks.elements.base import Task

_OF_FINGER = "finger_"


def resize(task: Task, sizes: Mapping[str, float]) -> Task:
    """The same with these sizes.

    Raises UsageError where the task has no object or finger to change, or a size is unknown, ParameterError where it is
    out of its range.
    """
    if task.with_body is not None:
        return replace(task.with_body(_resized_body(task.stage.body, sizes)), name=str(TaskName.of(task.name, sizes)))
    if task.sized is None:
        raise UsageError(f"{task.name} has an object and a tool of its own; leave --object out, and sizes in brackets.")
    _check(sizes, SIZES)
    finger = {name: value for name, value in sizes.items() if name.startswith(_OF_FINGER)}
    rope = {name: value for name, value in sizes.items() if name not in finger}
    of_finger = {name.removeprefix(_OF_FINGER): value for name, value in finger.items()}
    made = task.sized(replace(task.rope, **rope), replace(task.finger, **of_finger))
    return replace(made, name=str(TaskName.of(task.name, sizes)))


def _resized_body(own: Body, sizes: Mapping[str, float]) -> Body:
    """The object with these sizes; without a mass, one bean or one piece of cloth stays as heavy as it is."""
    match own:
        case Beans():
            _check(sizes, BEAN_SIZES)
            count = round(sizes.get("count", own.count))
            if count != sizes.get("count", count):
                raise UsageError(f"count={sizes['count']:g} is no whole number of beans.")
            return replace(own, count=count, mass_kg=sizes.get("mass_kg", own.mass_kg * count / own.count))
        case Cloth():
            _check(sizes, CLOTH_SIZES)
            size_m = sizes.get("size_m", own.size_m)
            mass_kg = sizes.get("mass_kg", own.mass_kg * (size_m / own.size_m) ** 2)
            return replace(own, size_m=size_m, mass_kg=mass_kg)
        case Liquid():
            _check(sizes, LIQUID_SIZES)
            return replace(own, **sizes)
        case _:
            raise UsageError(f"A {type(own).__name__} has no sizes to change; leave --object out.")


def _check(sizes: Mapping[str, float], known: Mapping[str, tuple[float, float]]) -> None:
    for name, value in sizes.items():
        if name not in known:
            raise UsageError.unknown("size", name, known)
        check_range(name, value, *known[name])
