"""TOML files that people write by hand: the likeliest mistake is named, with its line."""

import difflib
import re
import sys
import tomllib
from collections.abc import Iterable, Mapping
from pathlib import Path
from typing import Any, Final

_UTF_16: Final = (b"\xff\xfe", b"\xfe\xff")
_PLACE: Final = re.compile(r"\(at line (\d+), column \d+\)")
_BARE: Final = re.compile(r"""\s*([\w.-]+)\s*=\s*([^\s"'\[{#][^"'\[{#]*?)\s*(#.*)?""")
"""A key with a value that is neither quoted nor a list nor a table."""


def read_toml(path: Path) -> dict[str, Any]:
    """The tables of the file; a byte order mark, as editors on Windows write it, is no part of them.

    Raises OSError where it cannot be read, and ValueError, with the line and the remedy, where it is no TOML.
    """
    data = path.read_bytes()
    if data.startswith(_UTF_16):
        raise ValueError("it is in UTF-16; save it as UTF-8")
    try:
        text = data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise ValueError(f"it is not in UTF-8 ({error.reason} at byte {error.start}); save it as UTF-8") from None
    try:
        return tomllib.loads(text)
    except tomllib.TOMLDecodeError as error:
        raise ValueError(f"{error}{_remedy(text, str(error))}") from None
    except (RecursionError, OverflowError) as error:
        raise ValueError(f"{type(error).__name__}: {error}") from None


def refuse_unknown(place: str, table: Mapping[str, Any], known: Iterable[str]) -> None:
    """Raises ValueError for a key of the table at `place` that nothing reads, naming the nearest that is read."""
    names = sorted(known)
    for key in table:
        if key not in names:
            near = difflib.get_close_matches(key, names, n=1)
            hint = f" Did you mean {near[0]!r}?" if near else ""
            raise ValueError(f"{place}{key!r} is not known.{hint} Known: {', '.join(names)}")


def finite_number(place: str, value: object) -> float:
    """The value as a number. Raises ValueError, which names the `place`, where it is none, or not finite."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise ValueError(f"{place} = {value!r} is no number")
    if not abs(value) <= sys.float_info.max:
        raise ValueError(f"{place} = {value!r} is no finite number")
    return float(value)


def whole_number(place: str, value: object) -> int:
    """The value as a number that counts something. Raises ValueError, which names the `place`, where it is none."""
    if isinstance(value, bool) or not isinstance(value, int) or not 0 <= value < 1 << 63:
        raise ValueError(f"{place} = {value!r} is no whole number from 0 on")
    return value


def words(place: str, value: object) -> tuple[str, ...]:
    """The value as a list of strings. Raises ValueError, which names the `place`, where it is none."""
    if not isinstance(value, list) or not all(isinstance(each, str) for each in value):
        raise ValueError(f"{place} = {value!r} is no list of strings; write such as [{str(value)!r}]")
    return tuple(value)


def _remedy(text: str, error: str) -> str:
    """Sentence on the line that the error names; empty where nothing about it is usual."""
    place = _PLACE.search(error)
    lines = text.splitlines()
    if place is None or not 0 < int(place[1]) <= len(lines):
        return ""
    bare = _BARE.fullmatch(lines[int(place[1]) - 1])
    if bare is None:
        return ""
    return f'; put the value of {bare[1]!r} in quotes, {bare[1]} = "{bare[2]}", or give a number'
