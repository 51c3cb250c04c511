"""Reader that replays a film in a loop in a thread of its own, each frame when it is due."""

import threading
import time
from dataclasses import replace
from typing import Final, final

from app.core.errors import RecordingError
from app.core.messages import Frame, fresh_id
from app.recording.read.film import Film, film_frames
from app.rig.replayed.pace import PlaybackSchedule

_CLOSE_S: Final = 5.0


@final
class Projector:
    """Holder of each camera's newest frame. Only `start` and `end` block."""

    def __init__(self, film: Film) -> None:
        self._film = film
        self._pace = PlaybackSchedule()
        self._shown: dict[str, Frame] = {}
        self._failure: RecordingError | None = None
        self._closing = threading.Event()
        self._thread = threading.Thread(target=self._run, name="film", daemon=True)

    def start(self) -> None:
        """Start the film from its beginning."""
        self._thread.start()

    def end(self) -> None:
        """Stop the film."""
        self._closing.set()
        self._thread.join(_CLOSE_S)

    def newest(self, camera: str) -> Frame | None:
        """The camera's current frame, None before its first. Raises RecordingError where the film is damaged."""
        if self._failure is not None:
            raise self._failure
        return self._shown.get(camera)

    def recorded_s(self) -> float:
        """The current moment of the recording [s]."""
        return self._pace.recorded_s(time.monotonic())

    def _run(self) -> None:
        try:
            while not self._closing.is_set():
                self._pace.begin()
                self._show_all()
        except RecordingError as error:
            self._failure = error

    def _show_all(self) -> None:
        """Play once from the beginning to the end, or until closed."""
        for frame in film_frames(self._film):
            due_s = self._pace.due_s(frame.time_s, time.monotonic())
            if self._closing.wait(max(0.0, due_s - time.monotonic())):
                return
            self._shown[frame.camera.name] = replace(frame, id=fresh_id("frame"), cause=(), time_s=due_s)
