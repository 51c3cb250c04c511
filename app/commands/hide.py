"""Record random pushes in a world with effects hidden in it.

The effects are written to a sealed file.

Example: dipac hide table_tilt --seed 1 -o hidden
"""

import os
from pathlib import Path
from typing import Annotated

import tyro
from rich.console import Console

from app.commands._hiding import PushRecordingConfig, Stopwatch, record
from app.commands._progress import counting
from app.commands._sealing import seal, truth_of, wish_of
from app.config import Site
from app.core.errors import UsageError
from app.core.geometry.scene_description import Rope, RopeModel
from app.core.task_name import recorded_name
from app.recording.write.preflight import Room, check_folder
from app.rig.simulated.cameras.cameras import CameraNoise
from app.rig.simulated.effect_sampling import check_world, draw, mistune
from app.rig.simulated.testbeds import find_testbed
from app.tasks import load

_MOST = 99
"""Largest number of episodes, and of pushes in one."""
_CAMERAS = 3
_NOISE_MM = 0.1, 5.0


def hide(
    effects: Annotated[
        tyro.conf.Positional[tuple[str, ...]],
        tyro.conf.arg(
            metavar="EFFECT[=SIZE] ...",
            help="effects of docs/hidden-effects.md; a control without any",
            help_behavior_hint="",
        ),
    ] = (),
    /,
    *,
    seed: Annotated[int, tyro.conf.arg(help="of everything that is drawn: world, pushes, directions, places, noise")],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], help="the folder of the recordings, new or empty")],
    episodes: Annotated[int, tyro.conf.arg(help="recordings to make")] = 8,
    pushes: Annotated[int, tyro.conf.arg(help="pushes, sweeps, carries or pours of each")] = 8,
    task: Annotated[
        str,
        tyro.conf.arg(
            help=(
                "rope_push, also with sizes, as 'rope_push(radius_m=0.006)', bean_sweep, cloth_hang, pour_water or "
                "pour_soup"
            )
        ),
    ] = "rope_push",
    cameras: Annotated[int, tyro.conf.arg(help="how many look on, 1 to 3")] = 2,
    depth_noise_mm: Annotated[
        float | None, tyro.conf.arg(help="of a pixel at the cameras' distance; 1.3 where it is left out")
    ] = None,
    world: Annotated[RopeModel, tyro.conf.arg(help="the rope: a chain of bodies, or an elastic cable")] = "chain",
    truth: Annotated[Path | None, tyro.conf.arg(help="the sealed file; by default OUTPUT.truth.json")] = None,
) -> None:
    """Sizes are in SI units; an effect without one has a random size.

    `dipac discover OUTPUT/*.mcap` is then to find what was hidden, without the sealed file.
    """
    terminal = Console(highlight=False, soft_wrap=True)
    sealed = truth or output.with_name(f"{output.name}.truth.json")
    _check(seed, episodes, pushes)
    _check_cameras(cameras, depth_noise_mm)
    known = load(recorded_name(task))
    testbed = find_testbed(known)
    body = testbed.body(known)
    if world != "chain" and not isinstance(body, Rope):
        raise UsageError(f"--world {world} is of tasks with a rope, not of {task}; leave it out.")
    physics = mistune(seed, world, body)
    hidden = draw([wish_of(text) for text in effects], seed, type(body))
    check_world(hidden, world)
    _check_places(output, sealed)
    session = PushRecordingConfig(
        task=known,
        plan=testbed.design(episodes, pushes),
        physics=physics,
        hidden=hidden,
        seed=seed,
        folder=output,
        cameras=cameras,
        noise=CameraNoise() if depth_noise_mm is None else CameraNoise.of_depth(1e-3 * depth_noise_mm),
    )
    watch = Stopwatch()
    _record(terminal, session, watch)
    seal(sealed, truth_of(session))
    spent = ", ".join(f"{part} {seconds:.0f} s" for part, seconds in watch.spent_s.items())
    terminal.print(f"{output}: {episodes * pushes} pushes in {episodes} episodes ({spent}).", markup=False)
    terminal.print(f"{sealed}: what is hidden in them; keep it from whoever is to find out.", markup=False)


def _check(seed: int, episodes: int, pushes: int) -> None:
    if seed < 0:
        raise UsageError(f"--seed {seed} is negative; choose 0 or more.")
    for option, count in (("--episodes", episodes), ("--pushes", pushes)):
        if not 1 <= count <= _MOST:
            raise UsageError(f"{option} {count} is outside 1 to {_MOST}; make several sessions for more.")


def _check_cameras(cameras: int, noise_mm: float | None) -> None:
    if not 1 <= cameras <= _CAMERAS:
        raise UsageError(f"--cameras {cameras} is outside 1 to {_CAMERAS}.")
    least, most = _NOISE_MM
    if noise_mm is not None and not least <= noise_mm <= most:
        raise UsageError(f"--depth-noise-mm {noise_mm:g} is outside {least:g} to {most:g}; leave it out for 1.3.")


def _check_places(output: Path, sealed: Path) -> None:
    """Check, before the work, that nothing is overwritten, and the truth does not lie with the recordings."""
    if output.is_dir() and any(output.iterdir()):
        raise UsageError(f"{output} is not empty; choose a new folder with -o, so that no two sessions mix.")
    if output.resolve() in sealed.resolve().parents:
        raise UsageError(f"{sealed} lies in {output}, with the recordings; choose another place with --truth.")
    if sealed.exists():
        raise UsageError(f"{sealed} exists; choose another place with --truth, so that no truth is lost.")
    if not os.access(sealed.resolve().parent, os.W_OK):
        raise UsageError(f"Cannot write {sealed}: no such folder, or not writable; choose another place with --truth.")
    check_folder(output, Room(min_free_bytes=Site().min_free_bytes))


def _record(terminal: Console, session: PushRecordingConfig, watch: Stopwatch) -> None:
    total = session.plan.episodes * session.plan.pushes
    with counting(terminal) as progress:
        bar = progress.add_task("pushes", total=total)
        for path in record(session, watch):
            progress.update(bar, advance=1, description=path.name)
