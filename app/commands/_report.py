"""Run the discovery pipeline on a study; write its results as files and print them."""

import hashlib
import time
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

from rich.console import Console

from app.commands._case import MODEL, VERDICT
from app.core.errors import ParameterError
from app.core.messages import Model
from app.discovery.checks.placement import centre
from app.discovery.dataset.model_under_test import Catalogue, Subject
from app.discovery.dataset.study import Study
from app.discovery.pipeline import discover as investigate
from app.discovery.results.case import Case
from app.jobs.discovery_subject import doubted_in
from app.jobs.extended import extended_model, fitted_parameters
from app.recording.exchange.model_file import save_model
from app.report import show_case, verdict_json, write_report
from app.sim.effects.base import MIDDLE, MIDDLE_M
from app.sim.model.catalogue import discover as effects_of_the_simulator
from app.tasks import load


def report_on(terminal: Console, study: Study, task: str, recordings: Sequence[Path], output: Path) -> Case:
    """Run the pipeline with the full name of a `task`, write its results to `output`, and show them."""
    began = time.monotonic()
    with terminal.status("") as status:

        def said(stage: str) -> None:
            terminal.print(f"[dim]{time.monotonic() - began:6.0f} s[/]  {stage}")
            status.update(stage)

        said("choice of the simulator")
        doubted = doubted_in(study, load(task))
        chosen_s = time.monotonic() - began
        case = investigate(study, doubted.subject, said, doubted.about)
        case = replace(case, spent_s=(("choice of the simulator", chosen_s), *case.spent_s))
    report = output / "report.html"
    write_report(report, case)
    (output / VERDICT).write_text(verdict_json(case, output / MODEL), encoding="utf-8")
    try:
        save_model(output / MODEL, _model(case, study, task, doubted.subject, recordings))
    except ParameterError as error:  # Of a place that is farther from the middle than any planner's table is wide.
        (output / MODEL).unlink(missing_ok=True)
        terminal.print(f"No {MODEL} is written, as no planner could use it: {error}")
    terminal.print(show_case(case, report))
    if case.origin_m != (0.0, 0.0):
        x, y = (middle + origin for middle, origin in zip(MIDDLE_M, case.origin_m, strict=True))
        terminal.print(
            f"The data lie about ({x:.2f}, {y:.2f}) m; in {MODEL} that is {MIDDLE}, the middle of the task's table."
        )
    return case


def _model(case: Case, study: Study, task: str, subject: Subject, recordings: Sequence[Path]) -> Model:
    """The extended model of `task` for `--model`; the refitted nominal one if no cause was found."""
    known = subject.catalogue()
    nominal = known.nominal(subject)
    values, covariance = fitted_parameters(known, nominal, case.extended, case.estimated, case.covariance)
    return extended_model(
        task,
        values,
        effects=_effects(known, case),
        covariance=covariance,
        recordings={path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in recordings},
        camera_m=centre(study, subject).camera,
        pushes=len(study.pushes),
        time_s=time.monotonic(),
    )


def _effects(known: Catalogue, case: Case) -> list[str]:
    """Names of the effects found: causes, and libraries that a formula has terms of."""
    causes = {step.cause for step in case.estimated}
    names = {known.specs[step.column].name for step in case.estimated}
    terms = [
        name
        for name, effect in effects_of_the_simulator().items()
        if not effect.catalogued and any(spec.name in names for spec in effect.parameters)
    ]
    return [cause.name for cause in known.causes if cause.name in causes] + terms
