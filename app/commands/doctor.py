"""Say what this installation lacks, and what mends it.

Example: dipac doctor
"""

import json as json_format
import sys
from concurrent.futures import ThreadPoolExecutor
from dataclasses import asdict
from pathlib import Path

from rich.console import Console
from rich.markup import escape
from rich.progress import track
from rich.table import Table

from app.commands._checks import Check, CheckResult, State, checks
from app.config import Site
from app.core.errors import PreflightError

_SITE = Site()
_MARKS: dict[State, str] = {"ok": "[green]ok[/]", "missing": "[red]missing[/]", "optional": "[yellow]optional[/]"}
_AT_ONCE = 2
"""Importing the native libraries keeps about this many cores busy."""


def doctor(
    *,
    json: bool = False,
    recordings: Path = _SITE.recordings,
    port: int = _SITE.console_port,
    cell: Path | None = None,
) -> None:
    """Look at Python, libraries, devices, disk and port. Exits with 3 where something required is missing.

    Args:
        json: Print one JSON document instead of the table.
        recordings: The folder that recordings would go to.
        port: The port that the console would use.
        cell: The file of a real cell, whose arm and cameras are looked at as well: docs/real-cell.md.
    """
    findings = _examine(Site(recordings=recordings, console_port=port), cell)
    if json:
        rows = [asdict(finding) for finding in findings]
        sys.stdout.write(json_format.dumps({"ok": not _missing(findings), "findings": rows}, indent=2) + "\n")
    else:
        _print(findings, Console())
    if missing := _missing(findings):
        raise PreflightError(f"{len(missing)} required: {', '.join(finding.what for finding in missing)}.")


def _examine(site: Site, cell: Path | None) -> list[CheckResult]:
    todo = (*checks(site), *(_of_cell(cell) if cell else ()))
    with ThreadPoolExecutor(max_workers=_AT_ONCE) as pool:
        results = pool.map(_carry_out, todo)
        progress = track(
            results,
            description="looking at libraries and devices",
            total=len(todo),
            console=Console(stderr=True),
            transient=True,
        )
        return [finding for found in progress for finding in found]


def _of_cell(file: Path) -> tuple[Check, ...]:
    """Loaded for those alone who have a cell: it needs libraries that the doctor may be asked about."""
    from app.commands._cell_checks import cell_checks

    return cell_checks(file)


def _carry_out(check: Check) -> list[CheckResult]:
    return check()


def _missing(findings: list[CheckResult]) -> list[CheckResult]:
    return [finding for finding in findings if finding.state == "missing"]


def _table(findings: list[CheckResult]) -> Table:
    table = Table("what", "state", "found", box=None, header_style="bold")
    table.columns[0].no_wrap = True
    table.columns[2].overflow = "fold"
    for finding in findings:
        table.add_row(finding.what, _MARKS[finding.state], escape(finding.found))
    return table


def _print(findings: list[CheckResult], output: Console) -> None:
    """The table; what mends each row stands below it unwrapped, to be copied."""
    output.print(_table(findings))
    for finding in findings:
        if finding.mend:
            output.print(f"\n[bold]{finding.what}[/]: {escape(finding.mend)}", soft_wrap=True, highlight=False)
