"""Show what the simulation gets wrong in recorded pushes, name the cause, extend the model, measure the gain."""

import hashlib
import time
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from app.commands._case import MODEL, VERDICT
from app.commands._named import Dynamics, full_name
from app.commands._preflight import make_folder
from app.commands._study import read_study
from app.core.errors import UsageError
from app.core.messages import Model
from app.discovery.case import Case
from app.discovery.chain import discover as investigate
from app.discovery.study import Study
from app.discovery.subject import Catalogue, Subject, catalogue
from app.recording.model_file import save_model
from app.sim.catalogue import discover as effects_of_the_simulator
from app.tasks import load
from app.tasks.doubted import subject_for
from app.tasks.extended import estimated, extended_model
from app.ui.report import show_case, verdict_json, write_report


def discover(
    recordings: tyro.conf.Positional[tuple[Path, ...]],
    /,
    *,
    task: Annotated[str | None, tyro.conf.arg(help="the task, where the recordings do not say it")] = None,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], help="the folder of the report")] = Path("discovery"),
    dynamics: Annotated[
        Dynamics | None, tyro.conf.arg(help="how a rope is simulated; as the task does where it is left out")
    ] = None,
) -> None:
    """Recordings of one task, each with its pushes. Writes report.html, verdict.json and model.toml to OUTPUT."""
    terminal = Console(highlight=False)
    if not recordings:
        raise UsageError("Name at least one recording: dipac discover recordings/*.mcap -o discovery")
    make_folder(output, "-o")
    with terminal.status("reading the recordings") as status:
        study = read_study(recordings, task=task)
        doubted = full_name(study.task, dynamics=dynamics)
        subject = subject_for(study, load(doubted))
        began = time.monotonic()

        def said(stage: str) -> None:
            terminal.print(f"[dim]{time.monotonic() - began:6.0f} s[/]  {stage}")
            status.update(stage)

        case = investigate(study, subject, said)
    report = output / "report.html"
    write_report(report, case)
    save_model(output / MODEL, _model(case, study, doubted, subject, recordings))
    (output / VERDICT).write_text(verdict_json(case), encoding="utf-8")
    terminal.print(show_case(case, report))


def _model(case: Case, study: Study, task: str, subject: Subject, recordings: Sequence[Path]) -> Model:
    """The extended model of `task` for `--model`; where nothing is missing, the refitted nominal one."""
    known = catalogue(subject.rods)
    nominal = known.nominal(subject)
    values, covariance = estimated(known, nominal, case.extended, case.estimated, case.covariance)
    return extended_model(
        task,
        values,
        effects=_effects(known, case),
        covariance=covariance,
        recordings={path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in recordings},
        camera_m=study.camera,
        pushes=len(study.pushes),
        time_s=time.monotonic(),
    )


def _effects(known: Catalogue, case: Case) -> list[str]:
    """What was found, by the names of its files: causes, and libraries that a formula has terms of."""
    causes = {step.cause for step in case.estimated}
    names = {known.specs[step.column].name for step in case.estimated}
    terms = [
        name
        for name, effect in effects_of_the_simulator().items()
        if not effect.catalogued and any(spec.name in names for spec in effect.parameters)
    ]
    return [cause.name for cause in known.causes if cause.name in causes] + terms
