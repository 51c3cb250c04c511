"""Pour-Water as in the reference problem: `python -m bench.pour_water [--bound 1|30]` prints a table of its metric.

The paper has 0.58 for CEM-MPC and 0.69 for DiPac; its environment, for doing nothing, 0.25 to 0.29.
"""

import json
import time
from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated, final

import numpy as np
import tyro
from rich.console import Console
from rich.table import Table

from bench.pouring.reference import DATA, SEEDS, STEPS, Outcome, best_while_held, problem
from bench.pouring.search import Budget, Found, Objective, Search


@final
@dataclass(frozen=True, kw_only=True)
class Options:
    """Size of the search, and its bound."""

    bound: Annotated[float, tyro.conf.arg(help="of every number of an action, before it is divided by 500")] = 1.0
    seeds: int = SEEDS
    objective: Annotated[Objective, tyro.conf.arg(help="'rim': bring water over the held bowl's rim")] = "goal"
    budget: Budget = field(default_factory=Budget)
    data: Path = DATA
    json: Path | None = None


def main(options: Options) -> None:
    """Search, print, and write every seed's line and actions."""
    console, began = Console(), time.perf_counter()
    given = problem(options.data)

    def say(what: str) -> None:
        console.print(f"{time.perf_counter() - began:6.0f} s  {what}")

    search = Search(
        given, seeds=options.seeds, bound=options.bound, budget=options.budget, objective=options.objective, say=say
    )
    _, still = search.outcomes(np.zeros((options.seeds, STEPS, 6), np.float32), np.arange(options.seeds))
    say(f"do nothing: {still.reward.mean():.3f} ({still.reward.min():.3f} to {still.reward.max():.3f})")
    say(f"water that stays in the held bowl: at most {best_while_held(given):.3f}")
    found = search.run()
    console.print(_table(found, options.bound))
    if options.json is not None:
        options.json.write_text("".join(json.dumps(_line(options.bound, s, one)) + "\n" for s, one in enumerate(found)))


def _table(found: list[Found], bound: float) -> Table:
    """Mean and range over the seeds."""
    table = Table(title=f"Pour-Water in our simulator, actions within +-{bound:g}, {len(found)} seeds")
    table.add_column("at the last step")
    for column in ("mean", "least", "most"):
        table.add_column(column, justify="right")
    for name in Outcome._fields:
        values = np.array([getattr(one.outcome, name) for one in found])
        table.add_row(name, *(f"{value:.4g}" for value in (values.mean(), values.min(), values.max())))
    return table


def _line(bound: float, seed: int, found: Found) -> dict[str, object]:
    outcome = {name: float(value) for name, value in found.outcome._asdict().items()}
    return {"bound": bound, "seed": seed, **outcome, "stages": found.stages, "actions": found.actions.tolist()}


if __name__ == "__main__":
    main(tyro.cli(Options))
