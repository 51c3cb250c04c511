"""Make recordings of random pushes in a world where effects are hidden; what they are goes to a sealed file."""

import hashlib
import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Annotated, Any

import tyro
from rich.console import Console

from app import __version__
from app.commands._hiding import Session, Stopwatch, record
from app.commands._preflight import unwritable
from app.commands._progress import counting
from app.config import Site
from app.core.errors import UsageError
from app.core.stage import RopeModel
from app.policy.strokes import Plan
from app.recording.preflight import Room, check_folder
from app.rig.simulated.hidden.base import Injected
from app.rig.simulated.hiding import Wish, check_world, draw, mistuned
from app.rig.simulated.physics import WorldPhysics
from app.rig.simulated.rehearsal import first_end
from app.tasks import load

_TASK = "rope_push"
_MOST = 99
"""Of episodes, and of pushes in one."""


def hide(
    effects: tyro.conf.Positional[tuple[str, ...]] = (),
    /,
    *,
    seed: Annotated[int, tyro.conf.arg(help="of everything that is drawn: world, pushes, directions, places, noise")],
    output: Annotated[Path, tyro.conf.arg(aliases=["-o"], help="the folder of the recordings, new or empty")],
    episodes: int = 8,
    pushes: int = 8,
    world: Annotated[RopeModel, tyro.conf.arg(help="the rope: a chain of bodies, or an elastic cable")] = "chain",
    truth: Annotated[Path | None, tyro.conf.arg(help="the sealed file; by default OUTPUT.truth.json")] = None,
) -> None:
    """Each effect is EFFECT or EFFECT=SIZE, in SI units; no effect at all makes a control. See docs/hidden-effects.md.

    `dipac discover OUTPUT/*.mcap` is then to find what was hidden, without the sealed file.
    """
    terminal = Console(highlight=False, soft_wrap=True)
    sealed = truth or output.with_name(f"{output.name}.truth.json")
    _check(seed, episodes, pushes)
    hidden = draw([wish_of(text) for text in effects], seed)
    check_world(hidden, world)
    _check_places(output, sealed)
    session = Session(
        task=load(_TASK),
        plan=Plan(episodes=episodes, pushes=pushes),
        physics=mistuned(seed, world),
        hidden=hidden,
        seed=seed,
        folder=output,
    )
    watch = Stopwatch()
    _record(terminal, session, watch)
    seal(sealed, truth_of(session))
    spent = ", ".join(f"{part} {seconds:.0f} s" for part, seconds in watch.spent_s.items())
    terminal.print(f"{output}: {episodes * pushes} pushes in {episodes} episodes ({spent}).", markup=False)
    terminal.print(f"{sealed}: what is hidden in them; keep it from whoever is to find out.", markup=False)


def wish_of(text: str) -> Wish:
    """EFFECT or EFFECT=SIZE, as somebody wrote it. Raises UsageError where what follows the = is no number."""
    name, equals, size = text.partition("=")
    try:
        return Wish(name, float(size) if equals else None)
    except ValueError:
        raise UsageError(
            f"{text!r} has no number after its =; write EFFECT or EFFECT=SIZE, such as table_tilt=1.5."
        ) from None


def _check(seed: int, episodes: int, pushes: int) -> None:
    if seed < 0:
        raise UsageError(f"--seed {seed} is negative; choose 0 or more.")
    for option, count in (("--episodes", episodes), ("--pushes", pushes)):
        if not 1 <= count <= _MOST:
            raise UsageError(f"{option} {count} is outside 1 to {_MOST}; make several sessions for more.")


def _check_places(output: Path, sealed: Path) -> None:
    """Before the work: nothing is overwritten, and the truth does not lie with the recordings."""
    if output.is_dir() and any(output.iterdir()):
        raise UsageError(f"{output} is not empty; choose a new folder with -o, so that no two sessions mix.")
    if output.resolve() in sealed.resolve().parents:
        raise UsageError(f"{sealed} lies in {output}, with the recordings; choose another place with --truth.")
    if sealed.exists():
        raise UsageError(f"{sealed} exists; choose another place with --truth, so that no truth is lost.")
    if not os.access(sealed.resolve().parent, os.W_OK):
        raise UsageError(f"Cannot write {sealed}: no such folder, or not writable; choose another place with --truth.")
    check_folder(output, Room(min_free_bytes=Site().min_free_bytes))


def _record(terminal: Console, session: Session, watch: Stopwatch) -> None:
    total = session.plan.episodes * session.plan.pushes
    with counting(terminal) as progress:
        bar = progress.add_task("pushes", total=total)
        for path in record(session, watch):
            progress.update(bar, advance=1, description=path.name)


def truth_of(session: Session, episodes: int | None = None) -> dict[str, Any]:
    """Everything that whoever is to find out must not know. `episodes`: recorded, where they are fewer than planned."""
    made = session.plan.episodes if episodes is None else episodes
    physics, paths = session.physics, [session.path(episode) for episode in range(made)]
    x, y = first_end(session.task, session.plan, session.seed).tolist()
    return {
        "version": __version__,
        "task": session.task.name,
        "seed": session.seed,
        "episodes": made,
        "pushes": session.plan.pushes,
        "effects": _effects(session.hidden),
        "world": {
            "table_friction": physics.table_friction,
            "finger_friction": physics.finger_friction,
            **_bending(physics),
            "first_end_m": [x, y],
        },
        "recordings": {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in paths},
    }


def _bending(physics: WorldPhysics) -> dict[str, float]:
    """Stiffness of the rope, by its model."""
    if physics.cable is None:
        return {"bend_stiffness_n_m_rad": physics.rope.bend_stiffness_n_m_rad}
    return {"rigidity_n_m2": physics.cable.rigidity_n_m2}


def _effects(hidden: Sequence[Injected]) -> list[dict[str, Any]]:
    return [
        {
            "effect": each.name,
            "family": each.effect.family,
            "catalogued": each.effect.catalogued,
            "parameters": {
                quantity.name: {"value": value, "unit": quantity.unit, "null": quantity.null}
                for quantity, value in zip(each.effect.quantities, each.values.tolist(), strict=True)
            },
        }
        for each in hidden
    ]


def seal(path: Path, truth: dict[str, Any]) -> None:
    """A new file that nobody can change, and its owner alone can read."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o400)
    except OSError as error:
        raise unwritable(path, "--truth", error) from None
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        json.dump(truth, file, indent=1)
