"""Verdicts on recordings without a report's extras, for tests and benches that need many."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import final

from threadpoolctl import threadpool_limits

from app.commands._named import full_name
from app.core.dialogue.model_monitor_messages import VerdictKind
from app.discovery.dataset.model_under_test import Subject, Theta
from app.discovery.dataset.study import Study
from app.discovery.pipeline import Stages, conclude, judge
from app.discovery.results.case import Estimate
from app.discovery.results.verdict import estimates_of, verdict_of
from app.discovery.unexplained.formula import NO_FORCE
from app.jobs.discovery_subject import doubted_in
from app.services.study import read_study
from app.tasks import load


@final
@dataclass(frozen=True, kw_only=True)
class Verdict:
    """Conclusion from recordings. `causes`: of the verdict; `probabilities` of all that were weighed.

    `unknown`: probability of an unknown force. `sizes`: parameters of each refitted cause, with their intervals.
    """

    kind: VerdictKind
    causes: tuple[str, ...]
    probabilities: Mapping[str, float]
    unknown: float = 0.0
    sizes: Mapping[str, tuple[Estimate, ...]] = field(default_factory=dict[str, tuple[Estimate, ...]])


def verdict(recordings: Sequence[Path]) -> Verdict:
    """The verdict of `dipac discover`, without the search for a formula."""
    study = read_study(recordings)
    doubted = doubted_in(study, load(full_name(study.task, dynamics=None)))
    return verdict_on(study, doubted.subject, doubted.about)


@threadpool_limits.wrap(limits=1, user_api="blas")
def verdict_on(study: Study, subject: Subject, about: Theta | None = None) -> Verdict:
    """The same of a study and the simulator that is doubted; `about`: see `judged`."""
    found = judge(study, subject, Stages(lambda _: None), about)
    decision, known = found.decision, found.predictor.catalogue
    kind, causes = verdict_of(decision, found.limits, NO_FORCE)  # Looking for one takes as long as all the rest.
    if kind == "named":
        kind, causes, *_ = conclude(found, NO_FORCE)
    sizes = {model.causes[0]: estimates_of(known, subject, model, model.causes[0]) for model in decision.singles}
    return Verdict(
        kind=kind,
        causes=causes,
        probabilities=dict(decision.probabilities),
        unknown=decision.unknown,
        sizes=sizes,
    )
