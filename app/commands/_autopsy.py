"""Simulate again what failed: say which substep broke, which particle, and what to change."""

from pathlib import Path

from rich.console import Console
from rich.table import Table
from rich.text import Text

from app.sim.autopsy import Autopsy, dissect
from app.sim.dump import Dump, load_dump, versions

_ROWS = 8
"""Of the table before the last states, evenly spread."""


def autopsy(file: Path) -> None:
    """Simulate the dump `file` again, and print what broke. Raises as `load_dump`."""
    terminal = Console(highlight=False)
    dump = load_dump(file)
    _print(terminal, _heading(dump))
    with terminal.status("simulating, with every state kept"):
        found = dissect(dump.case)
    if len(found.trace.speed_m_s):
        terminal.print(_table(dump, found))
    _print(terminal, found.verdict())


def _print(terminal: Console, text: str) -> None:
    terminal.print(Text(text), soft_wrap=True)


def _heading(dump: Dump) -> str:
    setup = dump.case.setup
    materials = ", ".join(type(body.material).__name__.lower() for body in setup.scene.bodies)
    tools = ", ".join(type(tool).__name__.lower() for tool in setup.scene.tools) or "none"
    wrote = ", ".join(f"{name} {version}" for name, version in dump.versions.items())
    other = "" if dict(dump.versions) == versions() else " These are not the versions here; the outcome may differ."
    return (
        f"{dump.about}: {sum(setup.counts)} particles ({materials}), {dump.case.substeps} substeps of "
        f"{setup.scene.dt_s:g} s, tools: {tools}, {len(setup.effects)} effects. Written by {wrote}.{other}"
    )


def _table(dump: Dump, autopsy: Autopsy) -> Table:
    """Evenly spread states, and the last ones each: a simulation breaks within a few substeps."""
    table = Table("substeps done", "max speed [m/s]", "cells a substep", "det F", "particles outside")
    trace, scene, end = autopsy.trace, dump.case.setup.scene, autopsy.until
    rows = {*range(0, end + 1, max(1, end // _ROWS)), *range(max(0, end + 1 - len(autopsy.last.x)), end + 1)}
    for row in sorted(rows):
        table.add_row(
            str(row),
            f"{trace.speed_m_s[row]:.4g}",
            f"{trace.speed_m_s[row] * scene.dt_s / scene.cell_m:.3g}",
            f"{trace.least_volume[row]:.3g} to {trace.greatest_volume[row]:.3g}",
            str(trace.outside[row]),
        )
    return table
