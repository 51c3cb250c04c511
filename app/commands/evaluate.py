"""Compare planners and ablations over seeds, in the simulated cell.

Writes a table, curves, and one line an episode.

Example: dipac evaluate --task rope_push --planner dipac cem_mpc --seeds 3 -o compared
"""

from collections.abc import Collection, Sequence
from pathlib import Path
from typing import Annotated, Any, Final, Literal

import tyro
from rich.console import Console
from rich.progress import TimeRemainingColumn

from app.commands._named import Dynamics, full_name
from app.commands._preflight import make_folder
from app.commands._progress import counting
from app.core.errors import UsageError
from app.core.geometry.scene_description import RopeModel
from app.core.task_name import Split
from app.evaluation import results_log
from app.evaluation.curves import draw
from app.evaluation.demonstrate import write_calibrated_model
from app.evaluation.episode import Eyes
from app.evaluation.scores import scores
from app.evaluation.tables import markdown, tables
from app.evaluation.trial import POLICIES, WHOLE, Trial, playable, run_trial
from app.evaluation.workers import Where, completed_rows, share_the_machine
from app.jobs.worker_api import check_model, choose_preset
from app.planner.method import ABLATIONS, NO_ONLINE, NO_REMAINDER, PAPER, planners
from app.recording.exchange.model_file import load_model
from app.tasks import load, names

EPISODES: Final = "episodes.jsonl"
_Names = Annotated[tuple[str, ...], tyro.conf.arg(metavar="NAME [NAME ...]")]


def evaluate(
    *,
    task: _Names = (),
    dynamics: Annotated[tuple[Dynamics, ...], tyro.conf.arg(metavar="{rods,mpm} [{rods,mpm} ...]")] = (),
    problems: Annotated[tuple[Split, ...], tyro.conf.arg(metavar="{easy,hard} [{easy,hard} ...]")] = (),
    planner: _Names = (),
    ablation: _Names = (),
    seeds: int = 10,
    demonstrations: int = 10,
    model: Path | None = None,
    policies: Path = POLICIES,
    online: bool = False,
    eyes: Eyes = "cameras",
    preset: Literal["auto", "cpu", "gpu"] = "auto",
    actions: int | None = None,
    play_on: bool = False,
    world: RopeModel = "chain",
    hidden: Path | None = None,
    workers: Where = "local",
    jobs: int = 1,
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"])],
) -> None:
    """Episodes that stand in OUTPUT/episodes.jsonl are not played again, so the same command goes on after a kill.

    Args:
        task: all tasks where none is named.
        dynamics: simulation of the object in plans: rods, for ropes, mpm, material points, or both; each
            task's own where none is named.
        problems: easy ones, which they are where nothing is named, hard ones, or both beside each other.
        planner: all planners where none is named, dipac, which is the paper's, where an ablation is. Besides: bc,
            transporter, act, diffusion and ild, a learned policy alone; dipac+bc and so on, the tree that it guides.
        ablation: one of dipac; all where none is named and no planner is; "none" for the whole planner alone.
        seeds: problems 0, 1, ... of each task.
        demonstrations: number by the scripted expert from which the model of each task is calibrated first.
        model: a model of one task, calibrated or by `dipac discover`, in place of that; OUTPUT/models keeps a copy.
        policies: the folder of learned policies, as `dipac train` writes them: TASK/KIND.
        online: the model also learns from each action of an episode, as it always does where demonstrations are of
            another object.
        eyes: rendered images, or the truth with the noise that particles from images have, which is faster.
        preset: size of the search for a decision; auto asks this machine.
        actions: at most, in an episode; the task's horizon where none is said.
        play_on: make all actions, also once the goal is reached, so that ends compare; success counts when it was seen.
        world: a simulated rope's: a chain of bodies joined by hinges, or an elastic cable of mass points.
        hidden: the sealed file of `dipac hide`: play in its world, with what is hidden in it, and with its frictions.
        workers: processes of this machine, or those of a Ray cluster.
        jobs: so many processes of this machine at a time.
        output: the folder of results, new or one to go on with.
    """
    terminal = Console(highlight=False, soft_wrap=True)
    _check(seeds, demonstrations, jobs, actions)
    share_the_machine()
    size = preset if preset != "auto" else choose_preset()
    methods, tasks = _methods(planner, ablation), _tasks(task, dynamics, problems)
    for name in tasks:
        load(name).preset(size)
        load(name).stage.in_world(world)
    models = {name: output / "models" / f"{name}.toml" for name in tasks}
    trials = [
        Trial(
            task=name,
            planner=chosen,
            ablation=left_out,
            seed=seed,
            preset=size,
            eyes=eyes,
            online=online,
            model=models[name],
            policies=policies,
            actions=actions,
            play_on=play_on,
            world=world,
            hidden=hidden,
        )
        for seed in range(seeds)
        for name in tasks
        for chosen, left_out in methods
        if _leaves_out(left_out, name, size, online=online)
    ]
    if not trials:
        raise UsageError(
            f"--ablation {NO_ONLINE} leaves nothing out where no model learns in use; add --online. "
            f"{NO_REMAINDER} leaves nothing out where plans are one action long."
        )
    for trial in {trial.task: trial for trial in trials}.values():
        _ = trial.hidden_world
    make_folder(output / "models", "-o")
    with results_log.folder_lock(output):
        if model is not None:
            _keep(model, models)
        _calibrate(terminal, [trial for trial in trials if trial.seed == 0], models, demonstrations)
        _play(terminal, trials, output / EPISODES, workers, jobs)
        _report(terminal, _rows(output / EPISODES, tasks), output)


def _leaves_out(ablation: str, task: str, preset: str, *, online: bool) -> bool:
    """False for an ablation that would change nothing."""
    if ablation == NO_ONLINE:
        return online or load(task).training_variant is not None
    return ablation != NO_REMAINDER or load(task).preset(preset).depth > 1


def _tasks(chosen: Sequence[str], dynamics: Sequence[Dynamics], problems: Sequence[Split]) -> tuple[str, ...]:
    """Their full names. Where none is chosen, all that have such dynamics and problems."""
    engines: Sequence[Dynamics | None] = dynamics or (None,)
    splits: Sequence[Split | None] = problems or (None,)
    full = [
        full_name(name, dynamics=engine, problems=split)
        for name in chosen or names()
        for split in splits
        for engine in engines
        if chosen or ((engine != "rods" or load(name).rods) and (split != "hard" or load(name).hard))
    ]
    return tuple(dict.fromkeys(full))


def _check(seeds: int, demonstrations: int, jobs: int, actions: int | None) -> None:
    counts = {
        "--seeds": seeds,
        "--demonstrations": demonstrations,
        "--jobs": jobs,
        "--actions": 1 if actions is None else actions,
    }
    for option, count in counts.items():
        if count < 1:
            raise UsageError(f"{option} {count} must be at least 1.")


def _methods(chosen: Sequence[str], left_out: Sequence[str]) -> list[tuple[str, str]]:
    """Planner and ablation of each method."""
    for name in chosen:
        if name not in playable():
            raise UsageError.unknown("planner", name, playable())
    for name in left_out:
        if name not in (WHOLE, *ABLATIONS):
            raise UsageError.unknown("ablation", name, [WHOLE, *ABLATIONS])
    parts = left_out or ((WHOLE,) if chosen else (WHOLE, *ABLATIONS))
    among = chosen or ([PAPER] if left_out else planners())
    if left_out and PAPER not in among:
        raise UsageError(f"--ablation {left_out[0]} is of {PAPER}, which --planner leaves out; add it there.")
    return list(dict.fromkeys((name, part) for name in among for part in (parts if name == PAPER else (WHOLE,))))


def _keep(model: Path, models: dict[str, Path]) -> None:
    """Copy the model to where those of these tasks are. Raises UsageError where it is of another task than any."""
    for name, path in models.items():
        check_model(load_model(model, task=name, time_s=0.0))
        content = model.read_bytes()
        if path.exists() and path.read_bytes() != content:
            raise UsageError(f"{path} is another model than {model}; choose another folder with -o.")
        path.write_bytes(content)


def _calibrate(terminal: Console, trials: Sequence[Trial], models: dict[str, Path], episodes: int) -> None:
    """The models that are not there yet, of tasks some method of which needs one."""
    for name, path in models.items():
        wanting = [trial for trial in trials if trial.task == name and trial.method.calibrated]
        if wanting and not path.exists():
            trial = wanting[0]
            with terminal.status(f"{name}: {episodes} demonstrations, and the model that they calibrate"):
                write_calibrated_model(name, trial.preset, episodes, trial.eyes, path, trial.world)
            terminal.print(f"{path}: calibrated; demonstrations: {episodes}.", markup=False)


def _play(terminal: Console, trials: Sequence[Trial], path: Path, workers: Where, jobs: int) -> None:
    before = _rows(path, {trial.task for trial in trials})
    _check_same(path, trials[0], before)
    _check_policies(path, trials, before)
    keys = {row["key"] for row in before if not row.get("lost")}
    left = [trial for trial in trials if trial.key not in keys]
    with counting(terminal, TimeRemainingColumn()) as progress:
        bar = progress.add_task("episodes", total=len(trials), completed=len(trials) - len(left))
        for trial, outcome in completed_rows(run_trial, left, where=workers, processes=jobs):
            row = outcome if isinstance(outcome, dict) else _lost(trial, outcome)
            results_log.append(path, {"key": trial.key} | row)
            progress.update(bar, advance=1)
            progress.console.print(f"{trial.key}: {_outcome_text(row)}", markup=False)


def _check_same(path: Path, trial: Trial, before: Sequence[dict[str, Any]]) -> None:
    """Raises UsageError where any episode before was played with other options."""
    for row in before:
        for name, value in trial.settings.items():
            before_it = row.get(name, getattr(Trial, name, value))  # Older rows lack what had no alternative then.
            if before_it != value:
                held = f"{path} holds episodes with {name.replace('_', '-')} {before_it}, not {value}"
                raise UsageError(f"{held}; go on with that, or choose another folder with -o.")


def _check_policies(path: Path, trials: Sequence[Trial], before: Sequence[dict[str, Any]]) -> None:
    """Raises UsageError where any episode before was played by a policy that was trained anew since."""
    learned = {(trial.task, trial.planner): trial.method.policy for trial in trials}
    for row in before:
        policy, digest = learned.get((row["task"], row["planner"])), row.get("policy_digest")
        if policy is not None and digest not in (None, policy.digest):
            held = f"{path} holds episodes of another policy for {row['planner']} in {row['task']}, trained before"
            raise UsageError(f"{held}; choose another folder with -o.")


def _lost(trial: Trial, why: str) -> dict[str, Any]:
    """The row of a trial whose process was lost, which the next evaluation plays again."""
    told = {"task": trial.task, "planner": trial.planner, "ablation": trial.ablation, "seed": trial.seed}
    empty = {name: list[Any]() for name in ("chamfers_m2", "rewards", "decisions_s", "parameters")}
    return (
        told
        | trial.settings
        | empty
        | {"chamfer_m2": None, "success": False, "reward": 0.0, "decision_s": 0.0, "failure": why, "lost": True}
    )


def _outcome_text(row: dict[str, Any]) -> str:
    if row["failure"]:
        return f"failed: {row['failure']}"
    ends = f"{1e6 * row['chamfers_m2'][0]:.0f} -> {1e6 * row['chamfer_m2']:.0f} mm^2"
    outcome = "success" if row["success"] else "no success"
    return f"{outcome}, {ends} in {len(row['decisions_s'])} actions, {row['decision_s']:.1f} s a decision"


def _rows(path: Path, tasks: Collection[str]) -> list[dict[str, Any]]:
    """All episodes of these tasks, by whatever command."""
    return [row for row in results_log.latest(path) if row["task"] in tasks]


def _report(terminal: Console, rows: Sequence[dict[str, Any]], output: Path) -> None:
    found = scores(rows)
    for drawn in tables(found):
        terminal.print(drawn)
    (output / "table.md").write_text(markdown(found), encoding="utf-8")
    listed = ", ".join(map(str, [output / "table.md", *draw(rows, output)]))
    terminal.print(f"{output / EPISODES}: {len(rows)} episodes; {listed}", markup=False)
