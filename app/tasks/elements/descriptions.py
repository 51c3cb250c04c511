"""Tasks with the object that a user describes: of its kind, in its colours, and what is known of its parameters."""

from collections.abc import Iterable, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Final

from app.core.bounds import check_range
from app.core.errors import ParameterError, UsageError
from app.core.geometry.object_description import ObjectDescription, ObjectType
from app.core.geometry.scene_description import Beans, Cloth, Liquid, Rope, Soup
from app.core.messages import Parameter
from app.tasks.elements.base import Task

_TYPES: Final[Mapping[type, ObjectType]] = MappingProxyType(
    {Rope: "rope", Beans: "beans", Cloth: "cloth", Liquid: "liquid"}
)


def object_type(task: Task) -> ObjectType | None:
    """Kind of the task's object, as a description has it; None of one that cannot be described."""
    return _TYPES.get(type(task.stage.body))


def check_object(task: Task, description: ObjectDescription, others: Iterable[Task]) -> None:
    """Raises UsageError where the object is of another kind than the task's, naming those of `others` that are of it.

    Raises ParameterError for priors of something else than the parameters of its simulator, in other units, or out of
    their ranges.
    """
    kind = object_type(task)
    if description.kind is not None and description.kind != kind:
        fitting = ", ".join(other.name for other in others if object_type(other) == description.kind)
        raise UsageError(
            f"It describes an object of kind {description.kind!r}, and {task.name} has "
            f"{repr(kind) if kind else 'one of its own'}; name a task of such a one: {fitting or 'none is'}."
        )
    _check_priors(task, description.priors)


def with_appearance(task: Task, description: ObjectDescription | None) -> Task:
    """The task with the object in its colours: as the simulated cell shows it, and as cameras find it."""
    if description is None:
        return task
    body, seen = task.stage.body, description.seen_colours
    if description.colour is not None and not isinstance(body, Soup):
        task = replace(task, stage=replace(task.stage, body=replace(body, colour=description.colour)))
    return task if seen is None else replace(task, perception=replace(task.perception, colour=seen))


def _check_priors(task: Task, priors: Iterable[Parameter]) -> None:
    from app.sim.model.params import NOMINAL_PHYSICS, PARAMETERS, index

    known = {spec.name for spec in NOMINAL_PHYSICS} | set(task.nominal)
    specs = task.parameters()
    for prior in priors:
        if prior.name not in known:
            raise ParameterError.unknown("parameter with a prior", prior.name, known)
        spec, unit = specs[index(prior.name)], PARAMETERS[index(prior.name)].unit
        if prior.unit and prior.unit != unit:
            raise ParameterError(f"[priors.{prior.name}] is in {prior.unit!r}; give it in {unit!r}.")
        for end in ("value", "low", "high"):
            check_range(f"[priors.{prior.name}] {end}", getattr(prior, end), spec.low, spec.high)
        if spec.scale == "log" and prior.low <= 0:
            raise ParameterError(f"[priors.{prior.name}] low = {prior.low:g} must be above 0.")
