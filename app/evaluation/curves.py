"""The Chamfer distance over the actions of episodes, as the paper draws it: means with their spread."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float64

from app.evaluation.figure import save
from app.evaluation.scores import MM2
from app.evaluation.trial import GUIDED, WHOLE
from app.planner.method import PAPER

_SHADED = 8
"""Number of methods above which the first alone is shaded, as so many shades are indistinguishable."""


def draw(rows: Sequence[dict[str, Any]], folder: Path, name: str = "chamfer") -> list[Path]:
    """A figure a task, `TASK-NAME.svg`, of all methods; returns the files.

    What a learned policy guides has the colour of that policy alone, and dashes.
    """
    from matplotlib import colormaps  # Takes a second to load, which nobody pays who draws nothing.
    from matplotlib.figure import Figure
    from matplotlib.ticker import MaxNLocator

    palette = [*colormaps["tab10"].colors, *colormaps["Dark2"].colors]  # type: ignore[attr-defined]
    drawn = list[Path]()
    for task in sorted({row["task"] for row in rows}):
        figure = Figure(figsize=(9.5, 4.5), layout="constrained")
        axes = figure.add_subplot(xlabel="actions", ylabel="Chamfer distance to the goal [mm$^2$]", yscale="log")
        axes.set_title(f"{task}: mean over seeds; shaded: the middle four fifths")
        colours, methods = dict[str, Any](), _methods([row for row in rows if row["task"] == task])
        for index, (method, curves) in enumerate(methods.items()):
            _, guided, kind = method.rpartition(GUIDED)
            colour = colours.setdefault(kind, palette[len(colours) % len(palette)])
            label, dashes = f"{method} (n = {len(curves)})", "--" if guided else "-"
            axes.plot(curves.mean(axis=0), label=label, color=colour, linestyle=dashes)
            if index == 0 or len(methods) <= _SHADED:
                low, high = np.quantile(curves, (0.1, 0.9), axis=0)
                axes.fill_between(np.arange(curves.shape[1]), low, high, color=colour, alpha=0.12, linewidth=0)
        axes.xaxis.set_major_locator(MaxNLocator(integer=True))
        figure.legend(loc="outside right upper", fontsize="small")
        drawn.append(folder / f"{task}-{name}.svg")
        save(figure, drawn[-1], salt=task)
    return drawn


def _methods(rows: Sequence[dict[str, Any]]) -> dict[str, Float64[np.ndarray, "episodes actions"]]:
    """Each method's episodes [mm^2]; one that has ended stays where it was."""
    longest = max((len(row["chamfers_m2"]) for row in rows), default=0)
    found = dict[str, list[list[float]]]()
    for row in sorted(rows, key=lambda row: (row["planner"] != PAPER, row["ablation"] != WHOLE)):
        ended = row["chamfers_m2"]
        if ended:
            name = row["planner"] if row["ablation"] == WHOLE else f"{row['planner']}, {row['ablation']}"
            found.setdefault(name, []).append([*ended, *[ended[-1]] * (longest - len(ended))])
    return {name: MM2 * np.array(curves) for name, curves in found.items()}
