"""Entries of a dump's header: dataclasses of numbers, and effects by their names, as JSON has them."""

from collections.abc import Mapping, Sequence
from dataclasses import fields, is_dataclass
from typing import Any

import numpy as np

from app.core.errors import RecordingError, UsageError
from app.sim.effects.base import Effect
from app.sim.model.catalogue import discover
from app.sim.parameter import ParameterSpec


def fields_entry(given: Any, without: tuple[str, ...] = ()) -> dict[str, Any]:
    """Fields of a dataclass as JSON has them: a Python float comes back bit by bit."""
    return {each.name: _entry(getattr(given, each.name)) for each in fields(given) if each.name not in without}


def from_entry(entry: Any, known: Mapping[str, type] | None = None) -> Any:
    """The value of an entry: lists were tuples, and what has a class is one of the `known`.

    Raises UsageError for a class that is none of them.
    """
    if isinstance(entry, list):
        return tuple(from_entry(each, known) for each in entry)
    if not isinstance(entry, dict):
        return entry
    if known is None or entry["class"] not in known:
        raise UsageError.unknown("class", entry["class"], known or {})
    return known[entry["class"]](**{name: from_entry(each, known) for name, each in entry["fields"].items()})


def effect_names(effects: Sequence[Effect]) -> list[str]:
    """Files of effects. Raises UsageError for one that is no file of app/sim/effects."""
    names = {id(effect): name for name, effect in discover().items()}
    unknown = [effect for effect in effects if id(effect) not in names]
    if unknown:
        parameters = ", ".join(spec.name for effect in unknown for spec in effect.parameters)
        raise UsageError(f"The effect of {parameters} is not a file of app/sim/effects; only those can be dumped.")
    return [names[id(effect)] for effect in effects]


def named_effects(names: Sequence[str]) -> tuple[Effect, ...]:
    """The effects of these files. Raises UsageError for one that there is not."""
    known = discover()
    for name in names:
        if name not in known:
            raise UsageError.unknown("effect", name, known)
    return tuple(known[name] for name in names)


def check_parameters(specs: Sequence[ParameterSpec], said: Sequence[str]) -> None:
    """Raises RecordingError where parameters are not those that the header says."""
    names = [spec.name for spec in specs]
    if names != said:
        raise RecordingError(f"its parameters are {said}, and here they are {names}")


def _entry(given: Any) -> Any:
    if is_dataclass(given) and not isinstance(given, type):
        return {"class": type(given).__name__, "fields": fields_entry(given)}
    if isinstance(given, tuple):
        return [_entry(each) for each in given]
    return np.asarray(given).tolist()
