"""The hidden-effect suite: how often `dipac discover` names what was hidden, against the table of targets.

`dipac bench discovery --n 200 --into results.jsonl` draws 200 cases in each world and keeps a line a case; what is in
the file already is not done again, so that a long run survives a cut. `--jobs` cases run side by side, or with
`--workers ray` as many as a cluster has processors. `--first` and `--n` divide the cases over machines; `--merge` names
the files of the others. `--light` makes the cell's recordings without images. `--baselines` asks other methods, too.
`--made FOLDER` keeps the recordings, for another solver to be tried on the same. Without `--n` it only scores what is
there. `--report FOLDER` writes figures as SVG and tables as Markdown.
"""

import argparse
import time
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, get_args

from rich.console import Console

from app.commands._named import Dynamics
from app.core.errors import UsageError
from app.core.geometry.scene_description import Cloth, Rope
from app.discovery.dataset.model_under_test import Family
from app.evaluation.results_log import append
from app.evaluation.workers import Where, completed_rows
from app.policy.random_pushes import PushDesign
from bench.hidden import ledger
from bench.hidden.baselines import TITLES
from bench.hidden.curves import calibration_error, confusion, confusion_of_classes, power, reliability
from bench.hidden.draws import BODIES, SIZES, WORLDS, Case, CaseDistribution, Making, World, drawn, families_of
from bench.hidden.figures import write_figures
from bench.hidden.outcome import outcome
from bench.hidden.scores import rows
from bench.hidden.tables import (
    Grid,
    baseline_cells,
    confusion_table,
    family_cells,
    power_table,
    reliability_table,
    shown,
    target_lines,
    target_table,
    world_title,
    written,
)
from bench.hidden.trial import Setup, told, tried

_SEED = 20260
_DEADLINE_S = 7200.0


def main(options: Sequence[str] | None = None) -> None:
    given = _given(options)
    output = Console(highlight=False)
    dynamics: Dynamics = given.dynamics if BODIES[given.task] is Rope else "mpm"
    making = Making(dynamics=dynamics, images=not given.light, task=given.task)
    setup = Setup(
        seed=given.seed,
        plan=PushDesign(episodes=given.episodes, pushes=given.pushes),
        oracle=not given.no_oracle,
        deadline_s=given.deadline,
        making=making,
        cases=CaseDistribution(sizes=tuple(given.sizes), family=given.family),
        baselines=given.baselines,
        made=given.made,
    )
    given.into.parent.mkdir(parents=True, exist_ok=True)
    worlds: tuple[World, ...] = making.worlds if given.world == "both" else (given.world,)
    if not set(worlds) <= set(making.worlds):
        raise UsageError(f"{given.task} has no --world {given.world}; leave it out, or --task.")
    if not 0 < given.sizes[0] <= given.sizes[1]:
        raise UsageError("--sizes are two numbers above 0, the smaller one first: --sizes 1 2.")
    if given.family is not None and not all(families_of(making, world) & {given.family} for world in worlds):
        raise UsageError(f"Nothing of the family {given.family} can be hidden in these recordings; choose another one.")
    if given.light and making.body is Cloth:
        raise UsageError("--light stands for images of ropes and beans alone; leave it out for a cloth.")
    if given.light and making.dynamics == "mpm" and making.body is Rope:
        raise UsageError("--light makes ropes that are doubted as rods; leave --light or --dynamics mpm out.")
    numbers = range(given.first, given.first + given.n)
    cases = [drawn(given.seed, number, world, setup.making, setup.cases) for number in numbers for world in worlds]
    _try(output, cases, setup, given.into, given.merge, where=given.workers, jobs=given.jobs)
    lines = [line for line in ledger.read([*given.merge, given.into]) if _is_of(line, setup)]
    done = ledger.finished(lines)
    for line in lines:
        if line not in done:
            output.print(f"{ledger.key_of(line)} failed: {line.get('failure', 'no verdict')}", markup=False)
    show(output, done, given.report)


def _is_of(line: dict[str, Any], setup: Setup) -> bool:
    """True if the recordings of a line were made under the same conditions, and drawn from as many."""
    case, making = ledger.whole_case(line), setup.making
    if (tuple(case["sizes"]), case["family"]) != (setup.cases.sizes, setup.cases.family):
        return False
    seen = case["images"] == making.images or not making.is_of_cell(case["world"])
    return (case["task"], case["dynamics"]) == (making.task, making.dynamics) and seen


def show(output: Console, lines: Sequence[dict[str, Any]], report: Path | None) -> None:
    """All tables; where a folder is named, figures and tables in it, those of each world apart."""
    outcomes = [outcome(line) for line in lines]
    output.print(target_table(rows(outcomes)))
    text = [*target_lines(rows(outcomes)), ""]
    for world in WORLDS:
        for title, cells in _grids([line for line in lines if line["case"]["world"] == world], world):
            output.print(shown(title, cells))
            text += written(title, cells)
    if report is not None:
        report.mkdir(parents=True, exist_ok=True)
        (report / "targets.md").write_text("\n".join(text), encoding="utf-8")
    for world in WORLDS:
        own = [each for each in outcomes if each.world == world]
        if not own:
            continue
        bins, powers, confused = reliability(own), power(own), confusion(own)
        for table in (confusion_table(confusion_of_classes(own), world), confusion_table(confused, world)):
            output.print(table)
        output.print(reliability_table(bins))
        output.print(f"expected calibration error: {calibration_error(bins):.2f}")
        output.print(power_table(powers))
        if report is not None:
            output.print(", ".join(map(str, write_figures(report / world, confused, bins, powers))))


def _grids(lines: Sequence[dict[str, Any]], world: World) -> Iterator[tuple[str, Grid]]:
    """Tables of one world: by family, and beside other methods where they were asked."""
    if not lines:
        return
    yield f"By family, {world_title(world)}", family_cells([outcome(line) for line in lines])
    asked = [line for line in lines if "baselines" in line]
    if asked:
        methods = {"dipac discover": [outcome(line) for line in asked]}
        for name, title in TITLES.items():
            methods[title] = [outcome(line | {"verdict": line["baselines"][name]}) for line in asked]
        yield (
            f"The same cases by other methods, of discovery's residuals and slopes, {world_title(world)}",
            (baseline_cells(methods)),
        )


def _try(
    output: Console,
    cases: Sequence[Case],
    setup: Setup,
    into: Path,
    others: Sequence[Path],
    *,
    where: Where,
    jobs: int,
) -> None:
    """Try the cases without a verdict in any file, several in parallel."""
    done = {ledger.key_of(line) for line in ledger.finished(ledger.read([*others, into]))}
    left = [case for case in cases if ledger.key_of({"case": told(case, setup)}) not in done]
    began = time.monotonic()
    made = completed_rows(_tried, [(case, setup) for case in left], where=where, processes=jobs)
    for count, ((case, _), found) in enumerate(made, 1):
        line: dict[str, Any] = {"case": told(case, setup), "failure": found} if isinstance(found, str) else found
        append(into, line)
        rest_s = (time.monotonic() - began) / count * (len(left) - count)
        said = line.get("failure") or _short(line)
        output.print(f"{count}/{len(left)} {case.key}: {said}; {_clock(rest_s)} left", markup=False)


def _tried(job: tuple[Case, Setup]) -> dict[str, Any]:
    """A line of results, in a process or on a machine of its own."""
    return tried(*job)


def _short(line: dict[str, Any]) -> str:
    made = outcome(line)
    hidden = ", ".join(f"{truth.effect} x {truth.typical:.2g}" for truth in made.truths) or "nothing"
    named = " or ".join(cause.effect for cause in made.causes)
    return f"{hidden} -> {made.verdict} {named}".strip() + f" ({made.whole_s:.0f} s)"


def _clock(seconds: float) -> str:
    hours, minutes = divmod(round(seconds / 60), 60)
    return f"{hours} h {minutes} min" if hours else f"{minutes} min"


def _given(options: Sequence[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="dipac bench discovery", description=__doc__)
    parser.add_argument("--n", type=int, default=0, help="cases in each world; 0: score what is there")
    parser.add_argument("--first", type=int, default=0, help="number of the first of them")
    parser.add_argument("--task", choices=tuple(BODIES), default="rope_push", help="whose object is moved")
    parser.add_argument("--world", choices=(*WORLDS, "both"), default="both")
    parser.add_argument("--sizes", type=float, nargs=2, default=SIZES, metavar=("LOW", "HIGH"), help="in typical ones")
    parser.add_argument("--family", choices=get_args(Family), help="hide effects of this one alone, one in a recording")
    parser.add_argument("--seed", type=int, default=_SEED)
    parser.add_argument("--episodes", type=int, default=10)
    parser.add_argument("--pushes", type=int, default=20, help="in each episode")
    parser.add_argument("--jobs", type=int, default=1, help="cases side by side")
    parser.add_argument("--workers", choices=("local", "ray"), default="local", help="where they run")
    parser.add_argument("--dynamics", choices=("rods", "mpm"), default="rods", help="how ropes are simulated")
    parser.add_argument("--light", action="store_true", help="MuJoCo's world without images")
    parser.add_argument("--baselines", action="store_true", help="ask other methods about the same recordings")
    parser.add_argument("--into", type=Path, default=Path(".cache/bench-discovery/results.jsonl"))
    parser.add_argument("--merge", type=Path, nargs="*", default=[], help="results of other machines")
    parser.add_argument("--made", type=Path, help="a folder where recordings are kept, and taken from another time")
    parser.add_argument("--report", type=Path, help="a folder for figures and the table of targets")
    parser.add_argument("--no-oracle", action="store_true", help="do not ask what knowing the cause would gain")
    parser.add_argument("--deadline", type=float, default=_DEADLINE_S, help="seconds that a process may take")
    return parser.parse_args([] if options is None else list(options))
