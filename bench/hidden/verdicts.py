"""A verdict on recordings, without what a report adds to it: what is asked of discovery many times a test run."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from threadpoolctl import threadpool_limits

from app.commands._named import full_name
from app.commands._study import read_study
from app.discovery.case import Estimate, Name
from app.discovery.conclude import estimates_of, verdict_of
from app.discovery.decide import decide
from app.discovery.formula import Opened
from app.discovery.leftover import Leftover
from app.discovery.limits import limits_of
from app.discovery.predict import Predictor, prepare
from app.discovery.screen import refit, screen
from app.discovery.soundness import model_limits
from app.discovery.study import Study
from app.discovery.subject import Subject, catalogue
from app.tasks import load
from app.tasks.doubted import subject_for

_NOT_LOOKED_FOR: Final = Opened(Leftover(probability=0.0, by_chance=1.0), None)
"""Forces of no cause, which take as long as all the rest."""


@final
@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What is said of recordings. `causes`: of the verdict; `probabilities` of all that were weighed.

    `sizes`: of each cause that was refitted, its parameters with their intervals.
    """

    kind: Name
    causes: tuple[str, ...]
    probabilities: dict[str, float]
    sizes: dict[str, tuple[Estimate, ...]]


def verdict(recordings: Sequence[Path]) -> Verdict:
    """As `dipac discover` says it, but for what no cause explains."""
    study = read_study(recordings)
    return verdict_on(study, subject_for(study, load(full_name(study.task, dynamics=None))))


@threadpool_limits.wrap(limits=1, user_api="blas")
def verdict_on(study: Study, subject: Subject) -> Verdict:
    """The same of a study and the simulator that is doubted."""
    predictor, trials = Predictor(subject, catalogue(subject.rods)), prepare(study, subject)
    screening = screen(predictor, trials, refit(predictor, trials))
    trials = trials.turned(screening.ends)
    limits = (*limits_of(study, subject), *model_limits(trials, screening.data))
    decision = decide(predictor, trials, screening, lambda _: None)
    kind, causes = verdict_of(decision, limits, _NOT_LOOKED_FOR)
    sizes = {
        model.causes[0]: estimates_of(predictor.catalogue, subject, model, model.causes[0])
        for model in decision.singles
    }
    return Verdict(kind=kind, causes=causes, probabilities=dict(decision.probabilities), sizes=sizes)
