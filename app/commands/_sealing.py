"""Effects to hide, as requested on the command line, and the sealed file with the truth."""

import hashlib
import json
import os
from pathlib import Path
from typing import Any

from app import __version__
from app.commands._hiding import PushRecordingConfig
from app.commands._preflight import unwritable
from app.core.errors import UsageError
from app.rig.simulated.effect_sampling import InjectionRequest, describe
from app.rig.simulated.push_session import first_end
from app.rig.simulated.worlds.physics import WorldPhysics


def wish_of(text: str) -> InjectionRequest:
    """Parse EFFECT or EFFECT=SIZE. Raises UsageError if SIZE is no number."""
    name, equals, size = text.partition("=")
    try:
        return InjectionRequest(name, float(size) if equals else None)
    except ValueError:
        raise UsageError(
            f"{text!r} has no number after its =; write EFFECT or EFFECT=SIZE, such as table_tilt=1.5."
        ) from None


def truth_of(session: PushRecordingConfig, episodes: int | None = None) -> dict[str, Any]:
    """Truth that the solver must not know. `episodes`: number recorded, if fewer than planned."""
    made = session.plan.episodes if episodes is None else episodes
    physics, paths = session.physics, [session.path(episode) for episode in range(made)]
    x, y = first_end(session.task, session.plan, session.seed).tolist()
    return {
        "version": __version__,
        "task": session.task.name,
        "seed": session.seed,
        "episodes": made,
        "pushes": session.plan.pushes,
        "effects": describe(session.hidden),
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


def seal(path: Path, truth: dict[str, Any]) -> None:
    """Write a new file that cannot be changed, and that its owner alone can read."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o400)
    except OSError as error:
        raise unwritable(path, "--truth", error) from None
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        json.dump(truth, file, indent=1)
