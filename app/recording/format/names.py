"""Unique file names by numbering."""

import itertools
from collections.abc import Iterator


def numbered_names(stem: str) -> Iterator[str]:
    """`stem`, then `stem-2`, `stem-3` and so on, without end."""
    yield stem
    yield from (f"{stem}-{number}" for number in itertools.count(2))
