"""The hidden-effect suite: how often `dipac discover` names what was hidden, against the table of targets.

`dipac bench discovery --n 200 --into results.jsonl` draws 200 cases in each world and keeps a line a case; what is in
the file already is not done again, so that a long run survives a cut. `--first` and `--n` divide the cases over
machines; `--merge` names the files of the others. `--made FOLDER` keeps the recordings, for another solver to be tried
on the same. Without `--n` it only scores what is there. `--report FOLDER` writes figures as SVG and the table of
targets as Markdown.
"""

import argparse
import time
from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor, as_completed
from pathlib import Path

from rich.console import Console

from app.evaluation.ledger import append
from app.policy.strokes import Plan
from bench.hidden import ledger
from bench.hidden.curves import calibration_error, confusion, confusion_of_classes, power, reliability
from bench.hidden.draws import WORLDS, Case, World, drawn
from bench.hidden.figures import write_figures
from bench.hidden.outcome import Outcome, outcome
from bench.hidden.scores import rows
from bench.hidden.tables import confusion_table, power_table, reliability_table, target_lines, target_table
from bench.hidden.trial import Setup, told, tried

_SEED = 20260
_DEADLINE_S = 7200.0


def main(options: Sequence[str] | None = None) -> None:
    given = _given(options)
    output = Console(highlight=False)
    setup = Setup(
        seed=given.seed,
        plan=Plan(episodes=given.episodes, pushes=given.pushes),
        oracle=not given.no_oracle,
        deadline_s=given.deadline,
        made=given.made,
    )
    given.into.parent.mkdir(parents=True, exist_ok=True)
    worlds: tuple[World, ...] = WORLDS if given.world == "both" else (given.world,)
    cases = [drawn(given.seed, given.first + number, world) for number in range(given.n) for world in worlds]
    _try(output, cases, setup, given.into, given.merge, given.jobs)
    lines = ledger.read([*given.merge, given.into])
    done = ledger.finished(lines)
    for line in lines:
        if line not in done:
            output.print(f"{ledger.key_of(line)} failed: {line.get('failure', 'no verdict')}", markup=False)
    show(output, [outcome(line) for line in done], given.report)


def show(output: Console, outcomes: Sequence[Outcome], report: Path | None) -> None:
    """All tables; where a folder is named, figures and the table of targets in it, those of each world apart."""
    output.print(target_table(rows(outcomes)))
    if report is not None:
        report.mkdir(parents=True, exist_ok=True)
        (report / "targets.md").write_text("\n".join(target_lines(rows(outcomes))) + "\n", encoding="utf-8")
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


def _try(output: Console, cases: Sequence[Case], setup: Setup, into: Path, others: Sequence[Path], jobs: int) -> None:
    """Those cases that no file has a verdict of, so many side by side."""
    done = {ledger.key_of(line) for line in ledger.finished(ledger.read([*others, into]))}
    left = [case for case in cases if ledger.key_of({"case": told(case, setup)}) not in done]
    began = time.monotonic()
    with ThreadPoolExecutor(jobs) as pool:
        running = {pool.submit(tried, case, setup): case for case in left}
        try:
            for count, future in enumerate(as_completed(running), 1):
                line = future.result()
                append(into, line)
                rest_s = (time.monotonic() - began) / count * (len(left) - count)
                said = line.get("failure") or _short(line)
                output.print(f"{count}/{len(left)} {running[future].key}: {said}; {_clock(rest_s)} left", markup=False)
        except BaseException:
            pool.shutdown(wait=False, cancel_futures=True)
            raise


def _short(line: dict[str, object]) -> str:
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
    parser.add_argument("--world", choices=(*WORLDS, "both"), default="both")
    parser.add_argument("--seed", type=int, default=_SEED)
    parser.add_argument("--episodes", type=int, default=10)
    parser.add_argument("--pushes", type=int, default=20, help="in each episode")
    parser.add_argument("--jobs", type=int, default=1, help="cases side by side")
    parser.add_argument("--into", type=Path, default=Path(".cache/bench-discovery/results.jsonl"))
    parser.add_argument("--merge", type=Path, nargs="*", default=[], help="results of other machines")
    parser.add_argument("--made", type=Path, help="a folder where recordings are kept, and taken from another time")
    parser.add_argument("--report", type=Path, help="a folder for figures and the table of targets")
    parser.add_argument("--no-oracle", action="store_true", help="do not ask what knowing the cause would gain")
    parser.add_argument("--deadline", type=float, default=_DEADLINE_S, help="seconds that a process may take")
    return parser.parse_args([] if options is None else list(options))
