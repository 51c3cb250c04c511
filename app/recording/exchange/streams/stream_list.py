"""List of the streams in a file of another program, as it is shown before anything is imported."""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import final


@final
@dataclass(frozen=True, kw_only=True)
class StreamInfo:
    """A topic, feature or column: its name, its type, its number of values, and what its first value shows."""

    name: str
    kind: str
    count: int
    detail: str = ""


@final
@dataclass(frozen=True, kw_only=True)
class StreamList:
    """Content of a file: what it is, in words, its streams, and remarks on what to do about it."""

    title: str
    streams: tuple[StreamInfo, ...]
    notes: tuple[str, ...] = ()

    def lines(self) -> Iterator[str]:
        """The content in words, a line a stream."""
        yield self.title
        yield from table([(it.name, it.kind, str(it.count), it.detail) for it in self.streams])
        yield from self.notes


def table(rows: Sequence[Sequence[str]]) -> Iterator[str]:
    """Rows with their columns below each other."""
    rows = [[" ".join(cell.split()) for cell in row] for row in rows]
    widths = [max(map(len, column)) for column in zip(*rows, strict=True)]
    for row in rows:
        yield "  ".join(cell.ljust(width) for cell, width in zip(row, widths, strict=True)).rstrip()
