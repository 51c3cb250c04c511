"""Performance of learned policies, from measured episodes: `python -m bench.learned`.

It prints the tables of docs/results.md and draws their figures. See `--help`.
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Any, Final

import tyro
from matplotlib import colormaps
from matplotlib.figure import Figure

from app.evaluation import results_log
from app.evaluation.curves import draw
from app.evaluation.figure import save
from app.evaluation.scores import MM2, Score, scores
from app.evaluation.tables import markdown
from app.evaluation.trial import GUIDED, WHOLE
from app.planner.method import PAPER
from app.policy.learned import kinds

_DOCS: Final = Path(__file__).parents[1] / "docs"
_MEASURED: Final = _DOCS / "measured"
_SHOWN: Final = (WHOLE, "no_policy", "no_planning")
"""Ablations of the planner with which learned policies are compared."""
_SEEDS, _TEN, _TASK = 10, 10, "rope_push"


def main(folder: Path = _MEASURED, images: Path = _DOCS / "images") -> None:
    """Print the tables, and draw `TASK-learned.svg` and `rope_push-demonstrations.svg`.

    Args:
        folder: of policies.jsonl and evaluation.jsonl, and of efficiency.jsonl, whose rows say how many demonstrations
            taught.
        images: where the figures go.
    """
    taught = results_log.latest(folder / "policies.jsonl")
    rows = [*_planners(folder / "evaluation.jsonl", {row["key"] for row in taught}), *taught]
    print(markdown(scores(rows)))
    for file in draw(rows, images, "learned"):
        print(file)
    counted = [{**row, "demonstrations": _TEN} for row in taught if row["task"] == _TASK]
    counted += {
        (row["key"], row["demonstrations"]): row for row in results_log.lines(folder / "efficiency.jsonl")
    }.values()
    found = _efficiency(counted)
    print(_table(found))
    _draw(found, images / f"{_TASK}-demonstrations.svg")


def _planners(file: Path, known: set[str]) -> list[dict[str, Any]]:
    """Rows without learned policies: the planners, and the paper's ablations; episodes that are not known yet."""
    return [
        row
        for row in results_log.latest(file)
        if row["ablation"] in _SHOWN and row["seed"] < _SEEDS and row["key"] not in known
    ]


_Found = dict[str, dict[int, Score]]
"""Scores by method and number of demonstrations."""


def _efficiency(rows: Sequence[dict[str, Any]]) -> _Found:
    found = _Found()
    for count in sorted({row["demonstrations"] for row in rows}):
        for score in scores([row for row in rows if row["demonstrations"] == count]):
            found.setdefault(score.planner, {})[count] = score
    pairs = [name for kind in kinds.names() for name in (kind, f"{PAPER}{GUIDED}{kind}")]
    return {name: found[name] for name in pairs if name in found}


def _table(found: _Found) -> str:
    counts = _counts(found)
    rows = [["method", *map(str, counts)], ["---"] * (1 + len(counts))]
    for method, each in found.items():
        rows.append([method, *(_told(each.get(count)) for count in counts)])
    return "\n".join("| " + " | ".join(row) + " |" for row in rows)


def _told(score: Score | None) -> str:
    return f"{100 * score.success.value:.0f}%, {MM2 * score.chamfer_m2.value:.0f}" if score else "-"


def _counts(found: _Found) -> list[int]:
    return sorted({count for each in found.values() for count in each})


def _draw(found: _Found, file: Path) -> None:
    figure = Figure(figsize=(9.5, 4.0), layout="constrained")
    reached, off = figure.subplots(1, 2)
    reached.set(xlabel="demonstrations", ylabel="success [%]", xscale="log", ylim=(-3, 103))
    off.set(xlabel="demonstrations", ylabel="final Chamfer distance [mm$^2$]", xscale="log", yscale="log")
    colours = dict(zip(kinds.names(), colormaps["tab10"].colors, strict=False))  # type: ignore[attr-defined]
    for method, each in found.items():
        _, guided, kind = method.rpartition(GUIDED)
        counts, colour, line = list(each), colours[kind], "--" if guided else "-"
        shares = [100 * score.success.value for score in each.values()]
        reached.plot(counts, shares, line, marker="o", color=colour, label=method)
        ends = [MM2 * score.chamfer_m2.value for score in each.values()]
        off.plot(counts, ends, line, marker="o", color=colour)
    for axes in (reached, off):
        axes.set_xticks(_counts(found), [str(count) for count in _counts(found)])
        axes.minorticks_off()
    figure.legend(loc="outside right upper", fontsize="small")
    save(figure, file, salt=_TASK)
    print(file)


if __name__ == "__main__":
    tyro.cli(main)
