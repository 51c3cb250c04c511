"""A verdict on recordings, without what a report adds to it: what is asked of discovery many times a test run."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Final, final

from threadpoolctl import threadpool_limits

from app.commands._named import full_name
from app.commands._study import read_study
from app.discovery.case import Name
from app.discovery.chain import Stages, judged
from app.discovery.conclude import verdict_of
from app.discovery.formula import Opened
from app.discovery.leftover import Leftover
from app.tasks import load
from app.tasks.doubted import subject_of

_NOT_LOOKED_FOR: Final = Opened(Leftover(probability=0.0, by_chance=1.0), None)
"""Forces of no cause, which take as long as all the rest."""


@final
@dataclass(frozen=True, kw_only=True)
class Verdict:
    """What is said of recordings. `causes`: of the verdict; `probabilities` of all that were weighed."""

    kind: Name
    causes: tuple[str, ...]
    probabilities: dict[str, float]


@threadpool_limits.wrap(limits=1, user_api="blas")
def verdict(recordings: Sequence[Path]) -> Verdict:
    """As `dipac discover` says it, but for what no cause explains."""
    study = read_study(recordings)
    subject = subject_of(load(full_name(study.task, dynamics=None)), study.setup)
    found = judged(study, subject, Stages(lambda _: None))
    kind, causes = verdict_of(found.decision, found.limits, _NOT_LOOKED_FOR)
    return Verdict(kind=kind, causes=causes, probabilities=dict(found.decision.probabilities))
