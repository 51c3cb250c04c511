"""Find out what the model lacks by pushes that it chooses.

In the simulated cell, or for your recordings.

Example: dipac probe rope_push --budget 24 -o probing
"""

from collections.abc import Sequence
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console
from rich.prompt import Confirm

from app.commands._arguments import TaskArgument
from app.commands._hiding import PushRecordingConfig
from app.commands._named import full_name
from app.commands._preflight import make_folder
from app.commands._probing import ProbedCell, believed_of, recommend
from app.commands._pushes import PUSHES, read_pushes, write_pushes
from app.commands._report import report_on
from app.commands._sealing import seal, truth_of, wish_of
from app.config import Site
from app.core.errors import UsageError
from app.discovery.experiments.probe import belief_words, stop_of, stop_words
from app.jobs.probed import probed_subject
from app.policy.random_pushes import PushDesign
from app.recording.write.preflight import Room, check_folder
from app.rig.simulated.effect_sampling import draw, mistune
from app.services.study import read_study
from app.tasks import load
from app.tasks.elements.base import Task

_MOST = 400
"""Pushes: an evening's."""


def probe(
    task: TaskArgument = "rope_push",
    /,
    *,
    output: Annotated[
        Path, tyro.conf.arg(aliases=["-o"], help="the folder of recordings and report, new or empty")
    ] = Path("probing"),
    budget: Annotated[int, tyro.conf.arg(help="pushes, at most")] = 48,
    batch: Annotated[int, tyro.conf.arg(help="pushes of an episode, after which everything is weighed again")] = 4,
    seed: Annotated[int, tyro.conf.arg(help="of what is drawn: world, noise, and pushes to choose from")] = 0,
    hide_effect: Annotated[
        tuple[str, ...], tyro.conf.arg(help="effects to hide in the simulated world, as `dipac hide` takes them")
    ] = (),
    approve: Annotated[bool, tyro.conf.arg(help="ask before each push")] = False,
    recordings: Annotated[
        tuple[Path, ...], tyro.conf.arg(help="move nothing: say what to push next after these, and write it to OUTPUT")
    ] = (),
    asked: Annotated[Path | None, tyro.conf.arg(help=f"a {PUSHES} whose pushes are made first")] = None,
) -> None:
    """Chosen pushes until a cause is named, none is left, or the budget is used; then the report of `dipac discover`.

    On a real arm the console does the same with each push approved: `dipac console TASK --probe`.
    """
    terminal = Console(highlight=False, soft_wrap=True)
    known = load(full_name(task, dynamics=None))
    probed_subject(known)
    _check(budget, batch, seed)
    if recordings:
        _recommend(terminal, known, recordings, output, batch, seed)
    else:
        _experiment(terminal, known, output, budget, batch, seed, hide_effect, approve, asked)


def _check(budget: int, batch: int, seed: int) -> None:
    if not 1 <= batch <= budget <= _MOST:
        raise UsageError(f"--batch {batch} and --budget {budget}: choose 1 <= batch <= budget <= {_MOST}.")
    if seed < 0:
        raise UsageError(f"--seed {seed} is negative; choose 0 or more.")


def _recommend(terminal: Console, task: Task, recordings: Sequence[Path], output: Path, count: int, seed: int) -> None:
    """Say and write what to push next."""
    make_folder(output, "-o")
    with terminal.status("reading the recordings") as status:
        study = read_study(recordings, task=task.recorded_name)
        status.update("weighing every cause")
        held = believed_of(task, study)
        terminal.print(_sentence(belief_words(held)), markup=False)
        status.update("choosing pushes")
        probes = recommend(task, study, held, count, seed=seed, site=Site())
    for number, each in enumerate(probes, 1):
        terminal.print(f"{number}. {each.text}.", markup=False)
    path = output / PUSHES
    write_pushes(path, task.recorded_name, probes)
    terminal.print(
        f"{path}: make them with `dipac console {task.recorded_name} --asked {path}`, or in the simulated cell with "
        f"`dipac probe {task.recorded_name} --asked {path}`.",
        markup=False,
    )


def _experiment(
    terminal: Console,
    task: Task,
    output: Path,
    budget: int,
    batch: int,
    seed: int,
    effects: Sequence[str],
    approve: bool,
    asked: Path | None,
) -> None:
    """Push in the simulated cell until there is a reason to stop, and report."""
    tracks = read_pushes(asked, task.recorded_name) if asked else ()
    hidden = draw([wish_of(text) for text in effects], seed)
    sealed = output.with_name(f"{output.name}.truth.json")
    if hidden and sealed.exists():
        raise UsageError(f"{sealed} exists; choose another folder with -o, so that no truth is lost.")
    if output.is_dir() and any(output.iterdir()):
        raise UsageError(f"{output} is not empty; choose a new folder with -o, so that no two experiments mix.")
    check_folder(output, Room(min_free_bytes=Site().min_free_bytes))
    plan = PushDesign(episodes=-(-budget // batch), pushes=batch)
    session = PushRecordingConfig(
        task=load(task.recorded_name), plan=plan, physics=mistune(seed), hidden=hidden, seed=seed, folder=output
    )

    def approved(text: str) -> bool:
        terminal.print(f"  next: {text}.", markup=False)
        return not approve or Confirm.ask("  Make it?", console=terminal, default=True)

    cell = ProbedCell(session, task, site=Site(), approve=approved, asked=tracks)
    _play(terminal, cell, task, budget)
    if hidden:
        seal(sealed, truth_of(session, len(cell.recordings)))
        terminal.print(f"{sealed}: what was hidden.", markup=False)


def _play(terminal: Console, cell: ProbedCell, task: Task, budget: int) -> None:
    """Episode after episode. A name is one where the whole chain of discovery gives it, too."""
    held = believed_of(task, None)
    while True:
        cell.play(held, min(cell.session.plan.pushes, budget - held.pushes))
        with terminal.status("weighing every cause"):
            study = read_study(cell.recordings, task=task.recorded_name)
            held = believed_of(task, study)
        terminal.print(_sentence(belief_words(held)), markup=False)
        stop = stop_of(held, budget)
        if stop is None:
            continue
        terminal.print(stop_words(held, stop), markup=False)
        case = report_on(terminal, study, task.name, cell.recordings, cell.session.folder)
        if stop != "named" or case.verdict == "named" or held.pushes >= budget:
            return
        terminal.print("Refits and episodes left out do not bear that name out yet; pushing on.")


def _sentence(words: str) -> str:
    return f"{words[0].upper()}{words[1:]}."
