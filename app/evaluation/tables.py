"""Scores as tables: for the terminal, and as Markdown for a page."""

import math
from collections.abc import Sequence

from rich.table import Table

from app.evaluation.intervals import Measured
from app.evaluation.scores import MM2, Score

_HEADS = (
    *("task", "method", "episodes", "failed", "success", "final Chamfer [mm^2]", "more than dipac [mm^2]"),
    *("reward", "actions", "decision, median / longest [s]"),
)


def table(found: Sequence[Score]) -> Table:
    """For the terminal."""
    drawn = Table(*_HEADS, title="Means and shares with 95 % intervals")
    for row in _cells(found):
        drawn.add_row(*row)
    return drawn


def markdown(found: Sequence[Score]) -> str:
    """The same as Markdown."""
    rows = [_HEADS, ["---"] * len(_HEADS), *_cells(found)]
    return "".join("| " + " | ".join(row) + " |\n" for row in rows)


def _cells(found: Sequence[Score]) -> list[list[str]]:
    return [
        [
            *(score.task, score.name, str(score.episodes), str(score.failed)),
            _measured(score.success, 100.0, "%"),
            _measured(score.chamfer_m2, MM2),
            _measured(score.worse_m2, MM2),
            _measured(score.reward, 1.0),
            *(f"{score.actions:.1f}", f"{score.decision_s:.2f} / {score.longest_s:.2f}"),
        ]
        for score in found
    ]


def _measured(value: Measured, unit: float, sign: str = "") -> str:
    if not value.n:
        return "-"
    return f"{_number(value.value * unit)}{sign} ({_number(value.low * unit)} to {_number(value.high * unit)})"


def _number(value: float) -> str:
    """Three digits that matter."""
    if not math.isfinite(value):
        return "-"
    return f"{value:.0f}" if abs(value) >= 100 else f"{value:.3g}"
