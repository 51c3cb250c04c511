"""Scores as text tables."""

import math
from collections.abc import Mapping, Sequence
from typing import TypeAlias

from rich.table import Table

from app.evaluation.intervals import Measured
from bench.hidden.curves import Bin, Confusion, Power
from bench.hidden.draws import WORLDS, World
from bench.hidden.outcome import ACTUATION, CONTACT, MATERIAL, SENSING, TIME, Outcome
from bench.hidden.scores import GAIN, IN_BASELINES, IN_FAMILY, SIZE, Limit, Row, of_family

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


Grid: TypeAlias = list[list[str]]
"""Rows of cells as text, titles of columns first."""


def family_cells(outcomes: Sequence[Outcome]) -> Grid:
    """Scores of cases with one effect, by its family, of one world."""
    families = [SENSING, ACTUATION, CONTACT, MATERIAL, TIME]
    cells = [["of one effect", *families]]
    for name, score in IN_FAMILY.items():
        measured = [score(of_family(outcomes, family)) for family in families]
        cells.append([name, *(_counted(each, _scale(name)) for each in measured)])
    return cells


def baseline_cells(methods: Mapping[str, Sequence[Outcome]]) -> Grid:
    """Scores of several methods on the same cases of one world."""
    cells = [["method", *methods]]
    for name, score in IN_BASELINES.items():
        cells.append([name, *(_counted(score(outcomes), _scale(name)) for outcomes in methods.values())])
    return cells


def shown(title: str, cells: Grid) -> Table:
    """The cells as a table for a terminal."""
    table = Table(title=title)
    for name in cells[0]:
        table.add_column(name)
    for row in cells[1:]:
        table.add_row(*row)
    return table


def written(title: str, cells: Grid) -> list[str]:
    """The cells as lines of Markdown."""
    head, *rows = ["| " + " | ".join(row) + " |" for row in cells]
    return [f"## {title}", "", head, "|---" * len(cells[0]) + "|", *rows, ""]


def world_title(world: World) -> str:
    """The world in words."""
    return _TITLES[world]


def confusion_table(confusion: Confusion, world: World) -> Table:
    """Table of a confusion matrix: rows are the hidden causes, columns the first answers, by number."""
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


def _scale(name: str) -> str:
    return "ratio" if name in (SIZE, GAIN) else "share"


def _counted(measured: Measured, scale: str) -> str:
    return f"{_measured(measured, scale)} (n = {measured.n})" if measured.n else "no case"


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
    if not math.isfinite(measured.low):
        return _number(measured.value, scale)
    return f"{_number(measured.value, scale)} ({_number(measured.low, scale)} to {_number(measured.high, scale)})"


def _number(value: float, scale: str) -> str:
    if not math.isfinite(value):
        return "-"
    if scale == "seconds":
        return f"{value:.0f} s"
    if scale == "megabytes":
        return f"{value:.0f} MB"
    return f"{value:.0%}" if scale == "share" else f"{value:.2f}"
