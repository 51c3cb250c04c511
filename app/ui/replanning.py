"""Replanning of a moment of a recording: the order, and the comparison of the plans. Pure."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from html import escape
from typing import Final, NamedTuple, final

import numpy as np

from app.core.dialogue import words
from app.core.messages import Proposal

AS_RECORDED: Final = "as recorded at that moment"


@final
@dataclass(frozen=True, kw_only=True)
class ReplanRequest:
    """Request to plan from `time_s` [s] with the model called `model`, or with that of the file `path` if given."""

    time_s: float
    model: str = AS_RECORDED
    path: str = ""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Replanned:
    """The plan recorded about that moment, if any, and the new one, with `model`."""

    then: Proposal | None
    again: Proposal
    model: str

    @property
    def apart_m(self) -> float:
        """Distance between the starts of the two motions [m]; NaN where there is only one."""
        if self.then is None:
            return float("nan")
        return float(np.linalg.norm(self.then.motion.positions[0] - self.again.motion.positions[0]))


class ComparisonRow(NamedTuple):
    """A quantity in the recorded and in the new plan."""

    name: str
    then: str
    again: str


def rows(found: Replanned) -> Iterator[ComparisonRow]:
    """The comparison in words."""
    then, again = found.then, found.again
    yield ComparisonRow("Model", f"version {then.model_version}" if then else words.NOTHING, found.model)
    yield ComparisonRow("Cost after descent", *_each(then, again, lambda plan: words.number(plan.chosen.cost_after)))
    yield ComparisonRow("Distance now", *_each(then, again, lambda plan: words.distance(plan.chamfer_m2)))
    yield ComparisonRow(
        "Predicted distance", *_each(then, again, lambda plan: words.distance(plan.predicted_chamfer_m2))
    )
    yield ComparisonRow("Chosen", *_each(then, again, words.origin))
    apart = f"{found.apart_m * 1e3:.0f} mm apart" if then else words.NOTHING
    yield ComparisonRow("The motions begin", "", apart)


def _each(then: Proposal | None, again: Proposal, said: Callable[[Proposal], str]) -> tuple[str, str]:
    return said(then) if then else words.NOTHING, said(again)


def card(found: Replanned | None, said: str) -> str:
    """Card of the progress, and of the comparison once there is one."""
    told = f"<small>{escape(said)}</small>" if said else ""
    if found is None:
        return f'<div class="dp" role="status">{told}</div>'
    lines = "".join(
        f"<tr><td>{escape(row.name)}</td><td>{escape(row.then)}</td><td>{escape(row.again)}</td></tr>"
        for row in rows(found)
    )
    head = "<tr><td></td><td><small>then</small></td><td><small>planned again</small></td></tr>"
    return f'<div class="dp" role="status">{told}<table>{head}{lines}</table></div>'
