"""The cameras of a recording, opened together."""

from collections.abc import AsyncGenerator, Callable, Sequence
from contextlib import asynccontextmanager
from dataclasses import dataclass
from typing import Final, final

import anyio
from anyio import to_thread

from app.config import Timing
from app.recording.read.film import Film
from app.rig.replayed.camera import ReplayedCamera
from app.rig.replayed.projector import Projector

_MUCH_S: Final = 2.0
"""Duration of left-out images that deserves a note [s]."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Screen:
    """The cameras, and the moment of the recording that they show now [s]."""

    cameras: Sequence[ReplayedCamera]
    recorded_s: Callable[[], float]


@asynccontextmanager
async def replayed_cameras(film: Film, timing: Timing) -> AsyncGenerator[Screen]:
    """The recorded images at their recorded pace, from the beginning as soon as they are open, in a loop."""
    projector = Projector(film)
    cameras = [
        ReplayedCamera(model, projector, words=_left_out(film, name), timeout_s=timing.camera_timeout_s)
        for name, model in film.cameras.items()
    ]
    await to_thread.run_sync(projector.start)
    try:
        yield Screen(cameras=cameras, recorded_s=projector.recorded_s)
    finally:
        with anyio.CancelScope(shield=True):
            await to_thread.run_sync(projector.end)


def _left_out(film: Film, camera: str) -> str:
    """Note on the camera's images that are left out; empty where they are few."""
    unseen_s = film.unseen_s.get(camera, 0.0)
    if unseen_s < _MUCH_S:
        return ""
    return f"the last {unseen_s:.0f} s of its recording are not shown, because another camera had ended"
