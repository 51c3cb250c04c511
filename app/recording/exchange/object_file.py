"""Objects as TOML files, written by hand or by the console's wizard, and read by `--object` (docs/objects.md).

Keys of the whole object stand at the beginning, and are those of a task's sizes: `length_m = 0.32`.
"""

import difflib
import re
from collections.abc import Mapping
from pathlib import Path
from types import MappingProxyType
from typing import Any, Final

import tomli_w

from app.core.colours import ColourRange
from app.core.errors import ParameterError, UsageError
from app.core.geometry.object_description import OBJECT_TYPES, SIZES_OF, ObjectDescription, ObjectType, Range
from app.core.geometry.shapes.base import Colour
from app.core.messages import Parameter
from app.core.system.disk import replacement
from app.recording.exchange.toml_file import finite_number, read_toml, refuse_unknown

_TABLES: Final = ("colours", "priors")
_WORDS: Final = ("kind", "name", "colour")
_BOUNDS: Final = ("hue_deg", "saturation", "value")
_PRIOR: Final = ("value", "low", "high")
_SCALES: Final[Mapping[str, tuple[str, float]]] = MappingProxyType(
    {
        "mm": ("m", 1e-3),
        "cm": ("m", 1e-2),
        "g": ("kg", 1e-3),
        "deg": ("rad", 0.017453292519943295),
        "ml": ("m3", 1e-6),
        "cm3": ("m3", 1e-6),
        "l": ("m3", 1e-3),
        "g_cm3": ("kg_m3", 1e3),
    }
)
"""Units that people write, the one that is read instead, and what one of them is in it."""
_THOUSANDTH: Final = 1e-3
_HEX: Final = re.compile(r"#([0-9a-fA-F]{2})([0-9a-fA-F]{2})([0-9a-fA-F]{2})")
_GREY: Final = 0.3
"""Saturation below which a colour is not told from a table's."""


def load_object(path: Path) -> ObjectDescription:
    """The object that the file describes.

    Raises UsageError, with the likeliest mistake, where it cannot be read or says something that nothing reads, and
    ParameterError where a number is out of its range.
    """
    try:
        return _object(read_toml(path))
    except OSError as error:
        raise UsageError(f"Cannot read the object {path}: {error.strerror}.") from None
    except ParameterError as error:
        raise ParameterError(f"{path}: {error}") from None
    except ValueError as error:
        raise UsageError(f"{path} describes no object: {error}. docs/objects.md has one of each kind.") from None


def save_object(path: Path, description: ObjectDescription) -> None:
    """Write it, so that `load_object` reads the same; in place of another object's file, and of no other file.

    Raises UsageError where the file cannot be written, or it describes no object, ParameterError where a number is out
    of its range.
    """
    table = _table(description)
    try:
        _object(table)
    except ParameterError:
        raise
    except ValueError as error:
        raise UsageError(f"This describes no object: {error}.") from None
    _refuse_other_file(path)
    try:
        with replacement(path) as new:
            new.write_text(tomli_w.dumps(table), encoding="utf-8")
    except OSError as error:
        raise _unwritable(path, error) from None


def _refuse_other_file(path: Path) -> None:
    """Raises UsageError where a file is there that is none of an object, or of one that cannot be."""
    try:
        if path.exists():
            load_object(path)
    except OSError as error:
        raise _unwritable(path, error) from None
    except ParameterError as error:
        raise UsageError(
            f"An object with a number out of its range is there, and stays: {error} Correct that file, or choose "
            "another name."
        ) from None
    except UsageError:
        raise UsageError(
            f"{path} is there, and cannot be read as the file of an object; choose another name."
        ) from None


def _unwritable(path: Path, error: OSError) -> UsageError:
    return UsageError(f"Cannot write the object to {path}: {error.strerror}; choose another place.")


def _table(description: ObjectDescription) -> dict[str, Any]:
    table: dict[str, Any] = {"kind": description.kind} if description.kind else {}
    if description.name:
        table["name"] = description.name
    if description.colour is not None:
        table["colour"] = list(description.colour)
    table |= dict(description.sizes)
    if description.colours is not None:
        table["colours"] = {name: list(getattr(description.colours, name)) for name in _BOUNDS}
    if description.priors:
        table["priors"] = {each.name: _entry(each) for each in description.priors}
    return table


def _entry(prior: Parameter) -> dict[str, Any]:
    unit = {"unit": prior.unit} if prior.unit else {}
    return {"value": prior.value, "low": prior.low, "high": prior.high} | unit


def _object(table: Mapping[str, Any]) -> ObjectDescription:
    kind = _kind(table["kind"]) if "kind" in table else None
    known: dict[str, Range] = dict(SIZES_OF[kind]) if kind else {}
    if kind is None:
        for sizes in SIZES_OF.values():
            known |= sizes
    numbers = {key: value for key, value in table.items() if key not in (*_WORDS, *_TABLES)}
    for key, value in numbers.items():
        _refuse_other_unit(key, value, known)
    refuse_unknown("", numbers, [*known, *_WORDS, *_TABLES])
    sizes = {key: finite_number(key, value) for key, value in numbers.items()}
    if kind:
        for key, value in sizes.items():
            _check_size(key, value, known[key])
    colour = _colour(table["colour"]) if "colour" in table else None
    if colour is not None and "colours" not in table and _is_grey(colour):
        raise ValueError("its colour is nearly grey, and cameras find an object by its hue; give it [colours], too")
    return ObjectDescription(
        kind=kind,
        name=_word("name", table.get("name", "")),
        sizes=sizes,
        colour=colour,
        colours=_colours(_sub(table, "colours")) if "colours" in table else None,
        priors=tuple(_prior(name, entry) for name, entry in _sub(table, "priors").items()),
    )


def _check_size(name: str, value: float, limits: Range) -> None:
    """Raises ParameterError where a size is out of its range, and says so where it is one in another unit."""
    low, high = limits
    if low <= value <= high:
        return
    unit = name.rpartition("_")[2]
    small = {"m": "millimetres", "kg": "grams"}.get(unit)
    hint = ""
    if small and low <= value * _THOUSANDTH <= high:
        hint = f" Is it in {small}? Then write {name} = {value * _THOUSANDTH:g}."
    elif unit == "m" and low <= value * 1e-2 <= high:
        hint = f" Is it in centimetres? Then write {name} = {value * 1e-2:g}."
    raise ParameterError(f"{name} = {value:g} is outside its range {low:g} to {high:g}.{hint}")


def _refuse_other_unit(key: str, value: object, known: Mapping[str, Range]) -> None:
    """Raises ValueError for a known size in another unit, and says what to write."""
    for suffix, (unit, scale) in _SCALES.items():
        wanted = f"{key.removesuffix(f'_{suffix}')}_{unit}"
        if key.endswith(f"_{suffix}") and key not in known and wanted in known:
            number = isinstance(value, int | float) and not isinstance(value, bool)
            written = f"{wanted} = {finite_number(key, value) * scale:.6g}" if number else wanted
            raise ValueError(f"{key!r} is not known; write {written}")


def _kind(value: object) -> ObjectType:
    for kind in OBJECT_TYPES:
        if value == kind:
            return kind
    near = difflib.get_close_matches(str(value), OBJECT_TYPES, n=1)
    hint = f" Did you mean {near[0]!r}?" if near else ""
    raise ValueError(f"kind = {value!r} is no kind of object.{hint} Known: {', '.join(OBJECT_TYPES)}")


def _word(place: str, value: object) -> str:
    if not isinstance(value, str) or not value.isprintable():
        raise ValueError(f'{place} = {value!r} is no word; write such as {place} = "climbing cord"')
    return value


def _sub(table: Mapping[str, Any], name: str) -> Mapping[str, Any]:
    found = table.get(name, {})
    if not isinstance(found, dict):
        raise ValueError(f"{name} = {found!r} is no table; write [{name}] on a line of its own, and keys below it")
    return found


def _colour(value: object) -> Colour:
    """The colour, red, green and blue from 0 to 1."""
    if isinstance(value, str):
        found = _HEX.fullmatch(value)
        if found is None:
            raise ValueError(f'colour = {value!r} is no colour; write such as "#cc3d1a", or [0.8, 0.24, 0.1]')
        red, green, blue = (int(each, 16) / 255 for each in found.groups())
    elif isinstance(value, list) and len(value) == 3:
        red, green, blue = (finite_number("colour", each) for each in value)
    else:
        raise ValueError(f"colour = {value!r} is not red, green and blue; write such as [0.8, 0.24, 0.1]")
    if not all(0 <= each <= 1 for each in (red, green, blue)):
        raise ValueError(f'colour = {value!r} is not from 0 to 1; of 0 to 255 write such as "#cc3d1a"')
    return red, green, blue


def _is_grey(colour: Colour) -> bool:
    """True for a colour that a camera does not tell from a table's by its hue."""
    return max(colour) <= 0 or (max(colour) - min(colour)) / max(colour) < _GREY


def _colours(entry: Mapping[str, Any]) -> ColourRange:
    """Bounds of the colours in which it is found. Raises ParameterError where one is out of its scale."""
    refuse_unknown("[colours] ", entry, _BOUNDS)
    bounds = dict[str, Range]()
    for name in _BOUNDS:
        if name not in entry:
            raise ValueError(
                f"[colours] lacks {name!r}; write such as {name} = [{'350, 20' if name == 'hue_deg' else '0.35, 1'}]"
            )
        pair = entry[name]
        if not isinstance(pair, list) or len(pair) != 2:
            raise ValueError(f"[colours] {name} = {pair!r} is not its lower and its upper bound")
        bounds[name] = (finite_number(f"[colours] {name}", pair[0]), finite_number(f"[colours] {name}", pair[1]))
    return ColourRange.of(bounds["hue_deg"], bounds["saturation"], bounds["value"])


def _prior(name: str, entry: object) -> Parameter:
    """A prior. Raises ValueError, which names the key; names, units and ranges are the task's to check."""
    place = f"[priors.{name}] "
    if not isinstance(entry, dict):
        raise ValueError(f"priors.{name} = {entry!r} is no table; write [priors.{name}] with value, low and high")
    refuse_unknown(place, entry, (*_PRIOR, "unit"))
    for key in _PRIOR:
        if key not in entry:
            raise ValueError(f"{place}lacks {key!r}; it is a number with the ends of its 90 % interval")
    value, low, high = (finite_number(f"{place}{key}", entry[key]) for key in _PRIOR)
    if not low < high:
        raise ValueError(f"{place}low = {low:g} is not below high = {high:g}; they are the ends of its interval")
    if not low <= value <= high:
        raise ValueError(f"{place}value = {value:g} is outside of its own interval {low:g} to {high:g}")
    return Parameter(name=name, value=value, unit=_word(f"{place}unit", entry.get("unit", "")), low=low, high=high)
