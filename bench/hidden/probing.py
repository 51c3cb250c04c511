"""Pushes to a verdict, chosen against random: `python -m bench.hidden.probing lines.jsonl --worlds 40`.

Each world is a rope, a finger and frictions drawn anew, with one effect of the catalogue hidden, or nothing in a share
of them. It is played twice from the same beginning: with pushes that `app.discovery.experiments` chooses, and with
random ones. After each episode both are screened alike, until a cause is named or the pushes are used up. No images are
rendered, and no GPU is needed. What is done is not done again: an interrupted run goes on, and files of several
machines can be joined.
"""

import json
import os
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from multiprocessing import get_context
from pathlib import Path
from typing import Annotated, Any, Final, Literal, TypeAlias

import numpy as np
import tyro
from jaxtyping import Float64
from rich.console import Console
from rich.progress import track
from rich.table import Table
from threadpoolctl import threadpool_limits

from app.core.errors import PlanningError
from app.discovery.dataset.model_under_test import catalogue
from app.discovery.dataset.study import Push, Study
from app.discovery.experiments.probe import Belief, is_named
from app.evaluation.intervals import share
from app.evaluation.results_log import lines
from app.jobs.discovery_subject import subject_of
from app.jobs.probed import belief, next_probe
from app.policy.random_pushes import PushDesign
from app.rig.simulated.effect_sampling import injectable_effects
from app.tasks import load
from bench.hidden.draws import Chosen
from bench.hidden.ropes import RopeCase, bare_table, push_of, view_of

By: TypeAlias = Literal["chosen", "random"]
WAYS: Final[tuple[By, ...]] = ("chosen", "random")
NONE: Final = 0.15
"""Share of worlds in which nothing is hidden."""
SIZES: Final = 1.0, 2.0
"""Range of hidden sizes, in typical sizes, log-uniform."""
_TASK: Final = "rope_push@rods"
"""Task of the rope; effects that do not act on it are not hidden."""
_SEEN: Final = 13
"""Stream of random numbers of a seed."""
_RESAMPLED: Final = 2000


def drawn(seed: int, number: int, *, pushes: int, batch: int) -> RopeCase:
    """The world of that number; the same whatever others are drawn."""
    rng = np.random.default_rng([seed, number])
    hideable = {name for name, each in injectable_effects().items() if each.in_world or each.drive is not None}
    causes = {cause.name for cause in catalogue(subject_of(load(_TASK)).rods).causes}
    name, size = str(rng.choice(sorted(hideable & causes))), float(np.exp(rng.uniform(*np.log(SIZES))))
    hidden = () if rng.uniform() < NONE else (Chosen(effect=name, size=size),)
    plan = PushDesign(episodes=-(-pushes // batch), pushes=batch)
    return RopeCase(seed=int(rng.integers(2**31)), hidden=hidden, plan=plan)


@threadpool_limits.wrap(limits=1, user_api="blas")
def played(case: RopeCase, by: By) -> list[dict[str, Any]]:
    """Beliefs after each episode, until a cause is named or the pushes are used up."""
    task, session = case.task, case.session()
    rng = np.random.default_rng([case.seed, _SEEN])
    pushes, tables, told = list[Push](), {}, list[dict[str, Any]]()
    held = belief(task.name)
    while session.number < case.plan.episodes * case.plan.pushes:
        episode = session.episode
        tables[episode] = bare_table(rng)
        for _ in range(case.plan.pushes):
            seen = view_of(task, session.look(), rng)
            command = session.random()
            if by == "chosen":
                try:
                    probe = next_probe(task.name, held, seen, episode, pushes, case.plan, case.seed + session.number)
                except PlanningError:
                    pass  # Where nothing may be chosen, a random push brings the rope home.
                else:
                    command, held = probe.track, held.expecting(probe.information)
            pushes.append(push_of(task, seen, session.push(command), rng))
        held = belief(task.name, Study(task=task.recorded_name, pushes=tuple(pushes), tables=tables))
        told.append(_told(held, case))
        if is_named(held):
            break
    return told


def _told(held: Belief, case: RopeCase) -> dict[str, Any]:
    ranked = sorted(held.probabilities, key=lambda cause: -held.probabilities[cause])
    truth = case.hidden[0].effect if case.hidden else None
    return {
        "pushes": held.pushes,
        "first": ranked[0],
        "probability": round(held.probabilities[ranked[0]], 4),
        "nothing": round(held.nothing, 4),
        "rank": ranked.index(truth) + 1 if truth else None,
        "truth": round(held.probabilities[truth], 4) if truth else None,
        "named": is_named(held),
    }


def main(
    path: tyro.conf.Positional[Path],
    /,
    *,
    worlds: Annotated[int, tyro.conf.arg(help="to have at the end, each played both ways")] = 0,
    pushes: Annotated[int, tyro.conf.arg(help="at most, in a world")] = 32,
    batch: Annotated[int, tyro.conf.arg(help="pushes of an episode, after which all are screened")] = 4,
    seed: Annotated[int, tyro.conf.arg(help="of what is drawn")] = 0,
    workers: Annotated[int, tyro.conf.arg(help="processes")] = os.cpu_count() or 1,
) -> None:
    """Play the missing worlds, and compare all."""
    # Each process has a core to itself, and no accelerator: it would wait for its turn there.
    os.environ.setdefault("JAX_PLATFORMS", "cpu")
    terminal = Console()
    setup = {"pushes": pushes, "batch": batch}
    done = {(line["seed"], line["number"], line["by"]) for line in read(path, setup)}
    orders: list[tuple[int, int, By]] = [(seed, number, by) for number in range(worlds) for by in WAYS]
    context = get_context("spawn")
    with ProcessPoolExecutor(workers, mp_context=context) as pool, path.open("a", encoding="utf-8") as file:
        made = [pool.submit(_line, order, pushes, batch) for order in orders if order not in done]
        for future in track(as_completed(made), "worlds", total=len(made), console=terminal, disable=not made):
            file.write(json.dumps(future.result()) + "\n")
            file.flush()
    terminal.print(compared(read(path, setup), setup))


def read(path: Path, setup: Mapping[str, int]) -> list[dict[str, Any]]:
    """Worlds already played with as many pushes and as large episodes."""
    return [line for line in lines(path) if setup.items() <= line.items()]


def _line(order: tuple[int, int, By], pushes: int, batch: int) -> dict[str, Any]:
    seed, number, by = order
    case, began_s = drawn(seed, number, pushes=pushes, batch=batch), time.monotonic()
    told = played(case, by)
    hidden = [[each.effect, round(each.size, 3)] for each in case.hidden]
    spent_s = round(time.monotonic() - began_s, 1)
    return {
        "seed": seed,
        "number": number,
        "by": by,
        "pushes": pushes,
        "batch": batch,
        "hidden": hidden,
        "task": case.task.name,
        "spent_s": spent_s,
        "told": told,
    }


def compared(played_lines: Sequence[Mapping[str, Any]], setup: Mapping[str, int]) -> Table:
    """Comparison of both ways, in worlds that were played both ways; medians with bootstrapped 95 % intervals."""
    worlds = {(line["seed"], line["number"]): {} for line in played_lines}
    for line in played_lines:
        worlds[line["seed"], line["number"]][line["by"]] = line
    both = [each for _, each in sorted(worlds.items()) if set(each) == set(WAYS)]
    shown = Table(title=f"{len(both)} worlds, played both ways, up to {setup['pushes']} pushes")
    for heading in ("", *WAYS):
        shown.add_column(heading)
    hidden = [each for each in both if each["chosen"]["hidden"]]
    controls = [each for each in both if not each["chosen"]["hidden"]]
    beyond = float(setup["pushes"] + setup["batch"])
    for text, count in (("to the right name", _to_name), ("to the truth being first, and staying so", _to_first)):
        cells = [_median([count(each[by], beyond) for each in hidden], beyond) for by in WAYS]
        shown.add_row(f"median pushes {text} (n = {len(hidden)})", *cells)
    ratios = [_to_first(each["chosen"], beyond) / _to_first(each["random"], beyond) for each in hidden]
    shown.add_row("mean ratio of the latter, of each world", _mean(ratios), "1")
    for text, right in (("named rightly", True), ("named wrongly", False)):
        shown.add_row(f"{text}, of those", *(_rate([_named(each[by]) is right for each in hidden]) for by in WAYS))
    shown.add_row("truth first at the end", *(_rate([_rank(each[by]) == 1 for each in hidden]) for by in WAYS))
    shown.add_row("truth among three", *(_rate([_rank(each[by]) <= 3 for each in hidden]) for by in WAYS))
    wrong = (_rate([_named(each[by]) is not None for each in controls]) for by in WAYS)
    shown.add_row(f"named where nothing is (n = {len(controls)})", *wrong)
    seconds = (f"{np.median([each[by]['spent_s'] for each in both]):.0f}" if both else "-" for by in WAYS)
    shown.add_row("seconds a world, median", *seconds)
    return shown


def _named(line: Mapping[str, Any]) -> bool | None:
    """True if the named cause is the truth; None if none was named."""
    last = line["told"][-1]
    return last["first"] in [effect for effect, _ in line["hidden"]] if last["named"] else None


def _rank(line: Mapping[str, Any]) -> int:
    """Rank of the truth at the end."""
    return line["told"][-1]["rank"] or len(injectable_effects())


def _to_name(line: Mapping[str, Any], beyond: float) -> float:
    return float(line["told"][-1]["pushes"]) if _named(line) else beyond


def _to_first(line: Mapping[str, Any], beyond: float) -> float:
    """Pushes until the truth is the first suspect and stays it; `beyond` where it is not at the end."""
    found = beyond
    for told in reversed(line["told"]):
        if told["rank"] != 1:
            break
        found = float(told["pushes"])
    return found


def _median(values: Sequence[float], beyond: float) -> str:
    if not values:
        return "-"
    low, high = np.quantile(np.median(_resampled(values), axis=1), [0.025, 0.975])
    return f"{_pushes(float(np.median(values)), beyond)} ({_pushes(low, beyond)} to {_pushes(high, beyond)})"


def _pushes(value: float, beyond: float) -> str:
    return "more" if value >= beyond else f"{value:.0f}"


def _mean(values: Sequence[float]) -> str:
    if not values:
        return "-"
    low, high = np.quantile(_resampled(values).mean(1), [0.025, 0.975])
    return f"{np.mean(values):.2f} ({low:.2f} to {high:.2f})"


def _resampled(values: Sequence[float]) -> Float64[np.ndarray, "B S"]:
    return np.random.default_rng(0).choice(np.array(values, float), (_RESAMPLED, len(values)))


def _rate(found: Sequence[bool]) -> str:
    if not found:
        return "-"
    rate = share(found)
    return f"{sum(found)}, {rate.value:.2f} ({rate.low:.2f} to {rate.high:.2f})"


if __name__ == "__main__":
    tyro.cli(main)
