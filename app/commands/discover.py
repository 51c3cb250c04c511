"""Find out from recorded pushes what the simulation gets wrong.

Names the cause, extends the model, and measures the gain.

Example: dipac discover recordings/FILE.mcap -o discovery
"""

from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from app.commands._arguments import Files
from app.commands._named import Dynamics, check_description, full_name
from app.commands._preflight import make_folder
from app.commands._report import report_on
from app.core.errors import UsageError
from app.recording.exchange.object_file import load_object
from app.services.study import read_study


def discover(
    recordings: Files,
    /,
    *,
    task: Annotated[str | None, tyro.conf.arg(help="the task, where the recordings do not say it")] = None,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], help="the folder of the report")] = Path("discovery"),
    dynamics: Annotated[
        Dynamics | None, tyro.conf.arg(help="how a rope is simulated; as the task does where it is left out")
    ] = None,
    object: Annotated[  # noqa: A002  # The option's name.
        Path | None, tyro.conf.arg(help="a TOML file that describes the object; else as the recordings do")
    ] = None,
) -> None:
    """Recordings of one task, each with its pushes. Writes report.html, verdict.json and model.toml to OUTPUT."""
    terminal = Console(highlight=False)
    if not recordings:
        raise UsageError("Name at least one recording: dipac discover recordings/*.mcap -o discovery")
    make_folder(output, "-o")
    with terminal.status("reading the recordings"):
        description = load_object(object) if object else None
        study = read_study(recordings, task=task, description=description)
        if description is not None:
            check_description(description, study.task, f"{object}: ")
        doubted = full_name(study.task, dynamics=dynamics, sizes=description.sizes if description else {})
    report_on(terminal, study, doubted, recordings, output)
