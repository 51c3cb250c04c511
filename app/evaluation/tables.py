"""Scores as tables: for the terminal, and as Markdown for a page."""

import math
from collections.abc import Iterator, Sequence
from itertools import groupby

from rich.box import SIMPLE_HEAD
from rich.table import Table

from app.evaluation.intervals import Measured
from app.evaluation.scores import MM2, Score

_HEADS = (
    *("method", "episodes", "failed", "success", "final Chamfer [mm^2]", "more than dipac [mm^2]"),
    *("reward", "actions", "decision, median / longest [s]"),
)
_SHORT = ("method", "n", "success", "Chamfer [mm^2]", "more than dipac", "reward", "decision, longest [s]")


def tables(found: Sequence[Score]) -> Iterator[Table]:
    """Tables for the terminal, one a task, in 80 columns."""
    for task, scores in groupby(found, key=lambda score: score.task):
        drawn = Table(
            title=f"{task}: means and shares with 95 % intervals", box=SIMPLE_HEAD, padding=(0, 0, 0, 1), pad_edge=False
        )
        for index, head in enumerate(_SHORT):
            drawn.add_column(head, no_wrap=index == 0)
        for method, episodes, failed, success, chamfer, more, reward, _, decision in _cells(list(scores)):
            counted = episodes if failed == "0" else f"{episodes}, {failed} failed"
            # An interval stands under its value, so that all columns fit beside each other.
            measured = (
                cell.replace(" (", "\n(").replace(" / ", "\n") for cell in (success, chamfer, more, reward, decision)
            )
            drawn.add_row(method, counted, *measured)
        yield drawn


def markdown(found: Sequence[Score]) -> str:
    """The same as Markdown: a section a task."""
    text = list[str]()
    for task, scores in groupby(found, key=lambda score: score.task):
        rows = [_HEADS, ["---"] * len(_HEADS), *_cells(list(scores))]
        text.append(f"## {task}\n\n" + "".join("| " + " | ".join(row) + " |\n" for row in rows))
    return "\n".join(text)


def _cells(found: Sequence[Score]) -> list[list[str]]:
    return [
        [
            *(score.name, str(score.episodes), str(score.failed)),
            measurement(score.success, 100.0, "%"),
            measurement(score.chamfer_m2, MM2),
            measurement(score.worse_m2, MM2),
            measurement(score.reward, 1.0),
            *(f"{score.actions:.1f}", f"{score.decision_s:.2f} / {score.longest_s:.2f}"),
        ]
        for score in found
    ]


def measurement(value: Measured, unit: float, sign: str = "") -> str:
    """The value with its interval, in another unit; a dash where there is none."""
    if not value.n:
        return "-"
    text = f"{_number(value.value * unit)}{sign}"
    if not (math.isfinite(value.low) and math.isfinite(value.high)):
        return text
    return f"{text} ({_number(value.low * unit)} to {_number(value.high * unit)})"


def _number(value: float) -> str:
    """Three digits that matter."""
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
