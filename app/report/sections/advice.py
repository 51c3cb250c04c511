"""The next step after a verdict, in one to three sentences: its use, or the data that would change it."""

import shlex
from collections.abc import Iterator
from pathlib import Path
from typing import Final

from app.discovery.dataset.names import motion_name
from app.discovery.results.case import Case
from app.report.sections.verdict import is_missing_something

_SOURCE: Final = {
    "sensing": "Or take it away at its source: calibrate cameras and tool anew, and record again.",
    "actuation": "Or take it away at its source, in the arm's own controller, and record again.",
}
"""Advice by family of a cause that is better than a model that allows for it."""
MODEL: Final = Path("model.toml")
_SURE: Final = 0.95


def advice(case: Case, model: Path = MODEL) -> tuple[str, ...]:
    """Next steps, the most important first. `model`: the saved model's file."""
    return tuple(_advice(case, model))


def _advice(case: Case, model: Path) -> Iterator[str]:
    if any(limit.fatal for limit in case.limits):
        yield "Do not use a model from these recordings. Mend what is said above, record again, and ask again."
        return
    if case.verdict == "named" or case.formula is not None:
        yield f"Plan with the extended model, which is saved beside this report: {_run(case, model)}"
        families = {blame.family for blame in case.causes}
        if len(families) == 1 and (text := _SOURCE.get(next(iter(families)))) is not None:
            yield text
        if case.verdict == "named" and any(blame.probability < _SURE for blame in case.causes):
            yield from _more(case, "To be surer")
    elif case.verdict == "set":
        yield from _more(case, "To tell them apart")
        yield "Until then use none of them as if it were known."
    elif case.verdict == "none_of_these":
        yield "Do not trust the model where it errs (section 2), and look there for what is not in the catalogue."
        yield from _more(case, "To know more")
    elif is_missing_something(case):
        yield from _more(case, "To know more")
        yield "Until then keep the model as it is: no cause is sure enough to be added to it."
    elif case.gain.is_of_weak_model:
        yield "No cause stands out, but the refitted model explains little of the motion: see above what to check."
        yield from _more(case, "Then")
    else:
        yield f"Nothing has to be mended. The refitted model is saved beside this report: {_run(case, model)}"
        yield "“What would be visible” says how large a cause could be unseen; more motions show smaller ones."


def _run(case: Case, model: Path) -> str:
    """The command that plans with the saved model."""
    return f"dipac run {shlex.quote(case.amount.task)} --model {shlex.quote(str(model))}"


def _more(case: Case, why: str) -> Iterator[str]:
    """The most informative push, or more of any."""
    if case.next_push is not None:
        yield f"{why}, make this {motion_name(case.kind)} and ask again. {case.next_push.text}"
        if case.kind == "rope":
            yield f"A batch of such pushes: dipac probe {shlex.quote(case.amount.task)} --recordings FILES -o FOLDER"
    else:
        many = motion_name(case.kind, count=2)
        yield f"{why}, record as many {many} again, from other shapes of the object and in other directions."
