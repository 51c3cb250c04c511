"""Scores as text tables."""

import math
from collections.abc import Sequence

from rich.table import Table

from app.evaluation.intervals import Measured
from bench.hidden.curves import Bin, Confusion, Power
from bench.hidden.draws import WORLDS, World
from bench.hidden.scores import Limit, Row

_TITLES = {"own": "own engine, other numerics", "mujoco": "other engine (MuJoCo)"}


def target_table(rows: Sequence[Row]) -> Table:
    """Each target with its aim, what was measured with its 95 % interval and number of cases, in both worlds."""
    table = Table(title="Targets (95 % intervals; n)", show_lines=False)
    for column in ("target", *(f"{word} {_TITLES[world]}" for world in WORLDS for word in ("aim,", "measured,"))):
        table.add_column(column)
    for name in dict.fromkeys(row.target.name for row in rows):
        cells = {row.world: row for row in rows if row.target.name == name}
        table.add_row(name, *(text for world in WORLDS for text in _cells(cells[world])))
    return table


def target_lines(rows: Sequence[Row]) -> list[str]:
    """The same as lines of Markdown."""
    titles = [f"{word} {_TITLES[world]}" for world in WORLDS for word in ("Aim,", "Measured,")]
    lines = ["| Target | " + " | ".join(titles) + " |", "|---" * (1 + len(titles)) + "|"]
    for name in dict.fromkeys(row.target.name for row in rows):
        cells = {row.world: row for row in rows if row.target.name == name}
        lines.append(f"| {name} | " + " | ".join(text for world in WORLDS for text in _cells(cells[world])) + " |")
    return lines


def confusion_table(confusion: Confusion, world: World) -> Table:
    """Rows are what was hidden, columns what came first; columns by number, which the rows say."""
    table = Table(title=f"What was taken for what, {_TITLES[world]}")
    table.add_column("hidden")
    for number in range(len(confusion.names)):
        table.add_column(str(number + 1), justify="right")
    for number, (name, counts) in enumerate(zip(confusion.names, confusion.counts.tolist(), strict=True)):
        table.add_row(f"{number + 1} {name}", *(str(count) if count else "." for count in counts))
    return table


def reliability_table(bins: Sequence[Bin]) -> Table:
    """Stated probabilities and the share that is right."""
    table = Table(title="Whether stated probabilities hold")
    for column in ("stated", "mean", "right", "n"):
        table.add_column(column, justify="right")
    for each in bins:
        right = _measured(each.right, "share")
        table.add_row(f"{each.low:.1f} to {each.high:.1f}", _number(each.stated, "share"), right, str(each.right.n))
    return table


def power_table(powers: Sequence[Power]) -> Table:
    """The share that is named alone, and first, by class and size."""
    table = Table(title="Power by size, in typical sizes")
    for column in ("class", "size", "named alone", "first", "n"):
        table.add_column(column)
    for each in powers:
        table.add_row(
            each.category,
            f"{each.low:g} to {each.high:g}",
            _measured(each.named, "share"),
            _measured(each.first, "share"),
            str(each.named.n),
        )
    return table


def _cells(row: Row) -> tuple[str, str]:
    told = _measured(row.measured, row.target.scale)
    mark = {True: "met", False: "missed", None: ""}[row.met]
    counted = f"{told} (n = {row.measured.n}) {mark}".strip() if row.measured.n else "no case"
    return _aim(row.limit, row.target.scale), counted


def _aim(limit: Limit | None, scale: str) -> str:
    if limit is None:
        return "-"
    kind, first, second = limit
    if kind == "in":
        return f"{_number(first, scale)} to {_number(second, scale)}"
    return f"{kind} {_number(first, scale)}"


def _measured(measured: Measured, scale: str) -> str:
    if not measured.n:
        return "-"
    return f"{_number(measured.value, scale)} ({_number(measured.low, scale)} to {_number(measured.high, scale)})"


def _number(value: float, scale: str) -> str:
    if not math.isfinite(value):
        return "-"
    if scale == "seconds":
        return f"{value:.0f} s"
    return f"{value:.0%}" if scale == "share" else f"{value:.2f}"
