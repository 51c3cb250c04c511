"""Record demonstrations that an expert plays in a simulated cell.

Example: dipac collect rope_push --episodes 10
"""

import json
import shlex
from collections.abc import Mapping
from pathlib import Path
from typing import Annotated, Any, Literal

import tyro
from rich.console import Console
from rich.progress import TimeRemainingColumn

from app.commands._arguments import TaskArgument
from app.commands._named import Dynamics, full_name, read_description
from app.commands._preflight import make_folder
from app.commands._progress import counting
from app.core.errors import PlanningError, UsageError
from app.core.geometry.object_description import KEY
from app.core.geometry.scene_description import Rope, RopeModel
from app.core.messages import Episode, fresh_id
from app.core.task_name import Split
from app.evaluation.demonstrate import FIRST_SEED, Demonstration, Expert, demonstrations, record
from app.evaluation.episode import Eyes
from app.jobs.worker_api import choose_preset
from app.recording.read.reader import read_episode
from app.recording.write.writer import unused_path
from app.rig.simulated.cameras.cameras import table_cameras
from app.services.same_setup import COLLECTED, CollectionSetup, EarlierCollection, earlier_collection, require_same
from app.tasks import load

_TRIES = 5
"""Problems that are played for each recording, at most, where those that miss their goal are not kept."""


def collect(
    task: TaskArgument,
    /,
    *,
    episodes: int = 10,
    seed: int = FIRST_SEED,
    preset: Literal["auto", "cpu", "gpu"] = "auto",
    eyes: Eyes = "cameras",
    expert: Expert = "scripted",
    reached: bool = False,
    problems: Split | None = None,
    dynamics: Dynamics | None = None,
    world: RopeModel = "chain",
    object: Path | None = None,  # noqa: A002  # The option's name.
    resume: bool = False,
    output: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None,
) -> None:
    """One recording an episode, for `dipac calibrate` and for learning a policy. What is there already is kept.

    Episodes that miss their goal are recorded too, unless you say --reached: a calibration learns from every action,
    whatever it was good for, and a policy does as it was shown.

    Args:
        task: whose expert plays.
        episodes: number of recordings.
        seed: that of the first problem; the next ones count up.
        preset: whose number of particles the clouds have; auto asks this machine.
        eyes: rendered images, or the truth with the noise that particles from images have, which is faster.
        expert: the task's scripted policy, the same with its actions improved by descent, or the planner that it
            guides; each takes longer and errs less. What the planner does is partly chance, and harder to learn.
        problems: easy or hard ones (docs/evaluation.md); easy ones where neither this nor the task's name says so.
        dynamics: rods or mpm, what an expert simulates who does; the task's own where none is named.
        world: a simulated rope's: a chain of bodies joined by hinges, or an elastic cable of mass points.
        reached: record none that misses its goal, and play the next problem instead.
        object: a TOML file that describes the object (docs/objects.md).
        resume: go on with the collection in the folder, up to --episodes in all, if its set-up is this one.
        output: the folder of the recordings; recordings/TASK where none is named.
    """
    terminal = Console(highlight=False, soft_wrap=True)
    if episodes < 1 or seed < 0:
        raise UsageError(f"--episodes {episodes} must be at least 1, and --seed {seed} at least 0.")
    size = preset if preset != "auto" else choose_preset()
    description = read_description(object, task) if object else None
    sizes = description.sizes if description else {}
    full = full_name(task, dynamics=dynamics, problems=problems, sizes=sizes)
    task = load(full).recorded_name
    load(full).preset(size)
    load(full).demonstration_task.stage.in_world(world)
    folder = output or Path("recordings") / task
    make_folder(folder, "-o")
    setup: dict[str, Any] = {KEY: description.as_json} if description else {}
    setup[COLLECTED] = {"expert": expert, "eyes": eyes, "selection": "reached" if reached else "all"}
    kept = met = actions = 0
    if resume:
        earlier = earlier_collection(folder, task)
        require_same(earlier.setup, _setup(full, size, world, setup, eyes), folder)
        kept, seed = len(earlier.paths), _next_seed(earlier, seed)
        for line in (*earlier.skipped, f"{folder} holds {kept} recordings of this set-up."):
            terminal.print(line, markup=False)
    begun, wanted = kept, max(0, episodes - kept)
    seeds = range(seed, seed + (_TRIES if reached else 1) * wanted)
    with counting(terminal, TimeRemainingColumn()) as progress:
        bar = progress.add_task("episodes", total=wanted)
        for shown in demonstrations(full, size, seeds, eyes, expert, world, description):
            if reached and not (shown.played.success and shown.steps):
                progress.console.print(f"{task} {shown.config.seed}: {_outcome_text(shown)}; not kept", markup=False)
                continue
            path = unused_path(folder, f"{task}-{shown.config.seed:04d}")
            record(shown, path, setup)
            kept, met, actions = kept + 1, met + shown.played.success, actions + len(shown.steps)
            progress.update(bar, advance=1)
            progress.console.print(f"{path}: {_outcome_text(shown)}", markup=False)
            if kept == episodes:
                break
    terminal.print(f"{met} of {kept - begun} recorded episodes reached their goal, in {actions} actions together.")
    if kept < episodes:
        raise PlanningError(
            f"Of {len(seeds)} episodes {kept - begun} reached the goal, and are in {folder}; go on with --seed "
            f"{seeds.stop}, or try another --expert."
        )
    shown, name, where = f"{shlex.quote(str(folder))}/*.mcap", shlex.quote(task), shlex.quote(f"policies/{task}/bc")
    terminal.print(f"Calibrate with `dipac calibrate {shown} -o {shlex.quote(f'{task}.toml')}`,", markup=False)
    terminal.print(f"learn a policy with `dipac train {name} --demos {shown} -o {where}`.", markup=False)


def _setup(full: str, size: str, world: RopeModel, setup: Mapping[str, Any], eyes: Eyes) -> CollectionSetup:
    """The set-up of a collection that is asked for."""
    task = load(full)
    said = {"preset": size, **({"world": world} if isinstance(task.stage.body, Rope) else {}), **setup}
    episode = Episode(
        id=fresh_id("episode"),
        time_s=0.0,
        task=task.recorded_name,
        rig="simulated",
        seed=0,
        simulated=True,
        code_version="",
        config=json.dumps(said),
    )
    return CollectionSetup.of_episode(episode, table_cameras() if eyes == "cameras" else None)


def _next_seed(earlier: EarlierCollection, seed: int) -> int:
    """The first seed from `seed` on that is after those of the recordings that are there."""
    return max(seed, *(read_episode(path).seed + 1 for path in earlier.paths))


def _outcome_text(shown: Demonstration) -> str:
    played = shown.played
    if played.failure:
        return f"failed after {len(shown.steps)} actions: {played.failure}"
    outcome = "reached its goal" if played.success else "did not reach its goal"
    first_mm2, last_mm2 = 1e6 * played.chamfer_m2[0], 1e6 * played.chamfer_m2[-1]
    return f"{outcome}, {first_mm2:.0f} -> {last_mm2:.0f} mm^2 in {len(shown.steps)} actions"
