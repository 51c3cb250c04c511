"""Train a policy on demonstrations.

It is a file for `--policy`, with curves of how it went; what was broken off goes on.

Example: dipac train rope_push --demos recordings/rope_push -o policy
"""

import math
import shlex
from dataclasses import asdict
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console
from rich.progress import Progress as Bar
from rich.progress import TaskID, TimeRemainingColumn

from app.commands._arguments import TaskArgument
from app.commands._named import full_name
from app.commands._preflight import make_folder
from app.commands._progress import counting
from app.commands._version import code_version
from app.core.errors import SimulationError, UsageError
from app.core.task_name import recorded_name
from app.evaluation.learning import draw_learning
from app.jobs.teaching import examples, lessons, simulator
from app.jobs.worker_api import check_model, nominal_model
from app.policy.learned import kinds
from app.policy.learned.base import Lessons
from app.policy.learned.file import CHECKPOINT, FILE, Origin, load_training, save_policy, save_training, shape_of
from app.policy.learned.train import Progress, Training, TrainingSettings, begin, learn
from app.recording.exchange.model_file import load_model
from app.recording.format.digests import check_distinct
from app.recording.library.demonstrations import Demonstrations, read_taught
from app.recording.library.recording_index import counted_once
from app.tasks import load

_SAVE_EVERY = 500
"""Steps, between two checkpoints."""


def train(
    task: TaskArgument,
    /,
    *,
    demos: tuple[Path, ...],
    policy: str = "bc",
    steps: int = 4000,
    batch: int = 64,
    seed: int = 0,
    model: Path | None = None,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])] = Path("policy"),
) -> None:
    """Learn what was demonstrated, and what follows from it by the task's symmetries; the last recording is held out.

    Args:
        task: whose policy it is.
        demos: recordings or folders of them: ten are enough, of `dipac collect` or the console.
        policy: the way to learn; an unknown one is answered with all names.
        steps: at most; fewer where what is held out gains nothing any more.
        batch: situations that a step is made of.
        model: that of the simulator, for policies that learn by trying in it; the nominal one where none is named.
        seed: that of all draws: initial parameters, batches, symmetries, noise.
        output: the folder to write: the policy, curves, and what is needed to go on.
    """
    terminal = Console(highlight=False, soft_wrap=True)
    known, learner = (
        load(full_name(task, dynamics=None if model or "@" in task else "mpm", model=model)),
        kinds.load(policy),
    )
    if steps < 1 or batch < 1 or seed < 0:
        raise UsageError(f"--steps {steps} and --batch {batch} must be at least 1, and --seed {seed} at least 0.")
    make_folder(output, "-o")
    shown = _read_demos(demos, known.recorded_name)
    taught = examples(known, [(each.transitions, each.goals) for each in shown.values()])
    start = load_model(model, task=known.name, time_s=0.0) if model else nominal_model(known.name)
    check_model(start)
    how = lessons(known, simulator(known, start, taught.x.shape[1]))
    settings = TrainingSettings(steps=steps, batch=batch, seed=seed)
    hashes = {path.name: each.digest for path, each in shown.items()}
    told = _settings(task, policy, settings, hashes, how) | {"learner": asdict(learner)}  # type: ignore[call-overload]
    training = begin(learner, how, taught, settings)
    checkpoint = output / CHECKPOINT
    if checkpoint.exists():
        training = load_training(checkpoint, training, told)
        terminal.print(f"Going on with {checkpoint} from step {training.step}.", markup=False)
    terminal.print(f"Learning from {len(taught.x)} actions of {len(shown)} demonstrations.")
    with counting(terminal, TimeRemainingColumn()) as progress:
        bar = progress.add_task("steps", total=steps, completed=training.step)

        def listen(step: Progress) -> None:
            _tell(progress, bar, step)
            if step.step % _SAVE_EVERY == 0:
                save_training(checkpoint, training, told)

        found, training = learn(learner, how, taught, settings, training, listen)
    save_training(checkpoint, training, told)
    if not math.isfinite(training.best_loss):
        raise SimulationError(
            f"In {training.step} steps no loss was a number; train on other demonstrations, or by another --policy."
        )
    save_policy(output / FILE, found, _origin(known.problem, task, policy, settings, training, hashes, model))
    if training.left_out:
        terminal.print(f"{training.left_out} of {training.step} steps changed nothing: their slopes were no numbers.")
    if training.curve:
        draw_learning(training.curve, f"{task}: {policy}", output / "learning.svg")
    terminal.print(
        f"Held out loss {training.best_loss:.4g} after {training.step} steps; written to {output / FILE}. "
        f"Use it with `{shlex.join(['dipac', 'run', task, '--policy', str(output)])}`.",
        markup=False,
    )


def _read_demos(demos: tuple[Path, ...], task: str) -> dict[Path, Demonstrations]:
    """Each recording once. Raises UsageError where one is of another task."""
    if not demos:
        raise UsageError("Name at least one recording: dipac train TASK --demos recordings/TASK/*.mcap")
    shown = {path: read_taught(path) for path in counted_once(demos)}
    names = [path.name for path in shown]
    if twice := sorted({name for name in names if names.count(name) > 1}):
        raise UsageError(f"Recordings of the same name ({', '.join(twice)}) count once; leave out the others.")
    check_distinct({path: each.digest for path, each in shown.items()})
    others = {path.name: each.task for path, each in shown.items() if recorded_name(each.task) != task}
    if others:
        listed = ", ".join(f"{name}: {other}" for name, other in others.items())
        raise UsageError(f"These recordings are of other tasks than {task} ({listed}); leave them out.")
    return shown


def _settings(task: str, kind: str, settings: TrainingSettings, hashes: dict[str, str], how: Lessons) -> dict[str, Any]:
    """Settings that a resumed training must share; the order of demonstrations tells which one is held out."""
    phi = how.world.phi if how.world else ()
    told = {"task": task, "kind": kind, "demonstrations": list(hashes.items()), "phi": phi, "shape": shape_of(how)}
    return told | asdict(settings)


def _tell(progress: Bar, bar: TaskID, step: Progress) -> None:
    better = " *" if step.best else ""
    progress.update(bar, completed=step.step)
    progress.console.print(
        f"step {step.step}: loss {step.loss:.4g}, held out {step.held_out:.4g}{better}", markup=False
    )


def _origin(
    problem: str,
    task: str,
    kind: str,
    settings: TrainingSettings,
    training: Training,
    hashes: dict[str, str],
    model: Path | None,
) -> Origin:
    """Provenance, with a command that names files and no folders of this machine."""
    numbers = (("--steps", settings.steps), ("--batch", settings.batch), ("--seed", settings.seed))
    options = [text for name, number in numbers for text in (name, str(number))]
    started = ["--model", model.name] if model else []
    return Origin(
        task=problem,
        kind=kind,
        seed=settings.seed,
        steps=training.step,
        held_out_loss=training.best_loss,
        code_version=code_version(),
        command=shlex.join(["dipac", "train", task, "--policy", kind, *options, *started, "--demos", *hashes]),
        demonstrations=hashes,
    )
