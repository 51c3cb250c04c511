"""Aggregate scores of an evaluation's episodes, by method, compared with the paper's full planner."""

from collections.abc import Sequence
from statistics import median
from typing import Any, NamedTuple

from app.evaluation.intervals import Measured, mean, share
from app.evaluation.trial import WHOLE
from app.planner.method import PAPER

MM2 = 1e6
"""Square millimetres in a square metre."""


class Score(NamedTuple):
    """Scores of one method in one task. Chamfer distances [m^2] at the end, intervals of 95 %.

    `worse_m2`: the excess of its final distances over the full planner's on the same seeds; none if that has not played
    them. `failed` episodes count as unsuccessful, with the distance that they got to.
    """

    task: str
    planner: str
    ablation: str
    episodes: int
    failed: int
    success: Measured
    chamfer_m2: Measured
    worse_m2: Measured
    reward: Measured
    decision_s: float
    longest_s: float
    actions: float

    @property
    def name(self) -> str:
        """The planner, and its ablation."""
        return self.planner if self.ablation == WHOLE else f"{self.planner}, {self.ablation.replace('_', ' ')}"


def scores(rows: Sequence[dict[str, Any]]) -> list[Score]:
    """Scores of each method of each task: the full planner first, then its ablations, then the others."""
    groups = dict[tuple[str, str, str], list[dict[str, Any]]]()
    for row in rows:
        groups.setdefault((row["task"], row["planner"], row["ablation"]), []).append(row)

    def order(key: tuple[str, str, str]) -> tuple[str, bool, bool, str, str]:
        task, planner, ablation = key
        return task, planner != PAPER, ablation != WHOLE, planner, ablation

    return [_score(key, groups[key], groups.get((key[0], PAPER, WHOLE), [])) for key in sorted(groups, key=order)]


def _score(key: tuple[str, str, str], rows: list[dict[str, Any]], whole: list[dict[str, Any]]) -> Score:
    against = {row["seed"]: row["chamfer_m2"] for row in whole if row["chamfer_m2"] is not None}
    known = [row for row in rows if row["chamfer_m2"] is not None]
    decisions = [second for row in rows for second in row["decisions_s"]]
    paired = [row["chamfer_m2"] - against[row["seed"]] for row in known if row["seed"] in against]
    return Score(
        *key,
        episodes=len(rows),
        failed=sum(bool(row["failure"]) for row in rows),
        success=share(row["success"] for row in rows),
        chamfer_m2=mean(row["chamfer_m2"] for row in known),
        worse_m2=mean(paired if rows is not whole else []),
        reward=mean(row["reward"] for row in rows),
        decision_s=median(decisions) if decisions else 0.0,
        longest_s=max(decisions, default=0.0),
        actions=sum(len(row["decisions_s"]) for row in rows) / len(rows),
    )
