"""Reads a film over and over in a thread of its own, and shows each frame when it is due."""

import threading
import time
from dataclasses import replace
from typing import Final, final

from app.core.errors import RecordingError
from app.core.messages import Frame, fresh_id
from app.recording.film import Film, film_frames
from app.rig.replayed.pace import Pace

_CLOSE_S: Final = 5.0


@final
class Projector:
    """Of each camera the newest frame alone is kept. `start` and `end` block; all else never does."""

    def __init__(self, film: Film) -> None:
        self._film = film
        self._pace = Pace()
        self._shown: dict[str, Frame] = {}
        self._failure: RecordingError | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="film", daemon=True)

    def start(self) -> None:
        """Show the film from its beginning."""
        self._thread.start()

    def end(self) -> None:
        """Show nothing more."""
        self._closing.set()
        self._thread.join(_CLOSE_S)

    def newest(self, camera: str) -> Frame | None:
        """What that camera shows now, None before its first frame. Raises RecordingError where the film has torn."""
        if self._failure is not None:
            raise self._failure
        return self._shown.get(camera)

    def recorded_s(self) -> float:
        """The moment of the recording that is shown now [s]."""
        return self._pace.recorded_s(time.monotonic())

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                self._pace.begin()
                self._show_all()
        except RecordingError as error:
            self._failure = error

    def _show_all(self) -> None:
        """Once from the beginning to the end, or until it is closed."""
        for frame in film_frames(self._film):
            due_s = self._pace.due_s(frame.time_s, time.monotonic())
            if self._closing.wait(max(0.0, due_s - time.monotonic())):
                return
            self._shown[frame.camera.name] = replace(frame, id=fresh_id("frame"), cause=(), time_s=due_s)
