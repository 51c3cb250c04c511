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
from app.rig.simulated.push_session import first_start
from app.rig.simulated.testbeds import find_testbed


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
    start = first_start(session.task, session.plan, session.seed)
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
            **find_testbed(session.task).describe(physics, start),
        },
        "recordings": {path.name: hashlib.sha256(path.read_bytes()).hexdigest() for path in paths},
    }


def seal(path: Path, truth: dict[str, Any]) -> None:
    """Write a new file that cannot be changed, and that its owner alone can read."""
    try:
        descriptor = os.open(path, os.O_WRONLY | os.O_CREAT | os.O_EXCL, 0o400)
    except OSError as error:
        raise unwritable(path, "--truth", error) from None
    with os.fdopen(descriptor, "w", encoding="utf-8") as file:
        json.dump(truth, file, indent=1)
