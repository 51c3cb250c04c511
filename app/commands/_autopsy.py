"""Diagnosis of a dump by the engine that failed: the step, the part of the object, and the remedy."""

from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from app.sim.diagnosis.dump import Dump, load_dump, versions
from app.sim.diagnosis.faults import KEPT, StepTable

_ROWS = 8
"""Rows of the table before the last states, evenly spread."""


def autopsy(file: Path) -> None:
    """Simulate the dump `file` again, and print what broke. Raises as `load_dump`."""
    terminal = Console(highlight=False)
    dump = load_dump(file)
    _print(terminal, _heading(dump))
    with terminal.status("simulating, with every state kept"):
        found = dump.case.dissect()
    if len(found.trace):
        terminal.print(_table(found.trace, f"{found.unit}s done"))
    _print(terminal, found.verdict())


def _print(terminal: Console, text: str) -> None:
    terminal.print(Text(text), soft_wrap=True)


def _heading(dump: Dump) -> str:
    wrote = ", ".join(f"{name} {version}" for name, version in dump.versions.items())
    other = "" if dict(dump.versions) == versions() else " These are not the versions here; the outcome may differ."
    return f"{dump.about}: {dump.case.summary}. Written by {wrote}.{other}"


def _table(trace: StepTable, done: str) -> Table:
    """Evenly spread states, and the last ones each: a simulation breaks within a few steps."""
    columns, count = trace.columns(), len(trace)
    table = Table(done, *columns)
    rows = {*range(0, count, max(1, (count - 1) // _ROWS)), *range(max(0, count - KEPT), count)}
    for row in sorted(rows):
        table.add_row(str(row), *(column[row] for column in columns.values()))
    return table
