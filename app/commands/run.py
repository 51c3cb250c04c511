"""Run a task to its end in the simulated cell, by itself.

Example: dipac run rope_push --pushes 3
"""

from pathlib import Path
from typing import Annotated

import anyio
import tyro
from rich.text import Text

from app.commands._arguments import TaskArgument
from app.commands._episode import EpisodeReport, RunOptions, episode
from app.commands._options import Options
from app.commands._preflight import check_writable, unwritable
from app.core.dialogue.words import millimetres
from app.ui.terminal import Output

__all__ = ["EpisodeReport", "Options", "run"]


def run(
    task: TaskArgument = "rope_push",
    /,
    *,
    options: Annotated[Options, tyro.conf.arg(name="")] = Options(),
    json: Annotated[Path | None, tyro.conf.arg(help="write the outcome to this file")] = None,
) -> EpisodeReport:
    """Push the object to its goal; the console is served meanwhile, and STOP works there.

    Returns:
        The report that is printed; what ended the episode early is raised after that.
    """
    output = Output()
    order = RunOptions(asked=task, options=options, automatic=True)
    if json is not None:
        check_writable(json, "--json")
    report = anyio.run(episode, order, output)
    _summarise(report, output)
    if json is not None:
        _write(json, report)
    if report.failure is not None:
        raise report.failure
    return report


def _write(path: Path, report: EpisodeReport) -> None:
    try:
        path.write_text(report.to_json(), encoding="utf-8")
    except OSError as error:
        raise unwritable(path, "--json", error) from None


def _came(report: EpisodeReport) -> str:
    """Text about the outcome: whether the goal is reached, and what would bring it nearer."""
    if report.summary.reached:
        return "The goal is reached."
    if report.summary.exhausted:
        return "The goal is not reached, and no push that the planner finds promises to bring it nearer."
    return "The goal is not reached." + ("" if report.failure else " More pushes: --pushes.")


def _summarise(report: EpisodeReport, output: Output) -> None:
    chamfer_m2, last_m2 = report.summary.chamfer_m2, report.summary.last_chamfer_m2
    if last_m2 is not None:
        pushes = "1 push" if report.summary.pushes == 1 else f"{report.summary.pushes} pushes"
        output.print(
            f"\n[bold]{pushes}[/]: {millimetres(chamfer_m2[0]):.1f} mm -> "
            f"{millimetres(last_m2):.1f} mm from the goal; the Chamfer distance, their square, fell to "
            f"{last_m2 / chamfer_m2[0]:.0%} of its start. {_came(report)} Faults: {len(report.faults)}.",
            highlight=False,
            soft_wrap=True,
        )
    output.print(Text(f"Recording: {report.recording}"), soft_wrap=True)
