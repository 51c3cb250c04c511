"""Render loop: a thread that paints the state at most twelve times a second.

Any number of messages may come in between two frames; the latest state is painted. So a flood of messages costs a lock
each, and neither the program's loop nor a slow browser waits for the other.
"""

import logging
import threading
from collections.abc import Callable
from typing import final

from app.core.messages import Fault, fresh_id
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.operator_controller import OperatorController

_PERIOD_S = 1 / 12
_IDLE_S = 0.25
"""Period without news: ages tick on the screen all the same."""

_log = logging.getLogger(__name__)


@final
class RenderLoop:
    """Calls `paint(state, now_s)` from a thread of its own between `start` and `close`."""

    def __init__(self, controller: OperatorController, paint: Callable[[ConsoleState, float], None]) -> None:
        self._controller = controller
        self._paint = paint
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, name="console painter", daemon=True)
        self._failed: str | None = None

    def start(self) -> None:
        """Start the thread."""
        self._thread.start()

    def close(self) -> None:
        """Finish the frame and end."""
        self._ended.set()
        self._controller.changed.set()
        if self._thread.is_alive():
            self._thread.join()

    def _run(self) -> None:
        while not self._ended.is_set():
            self._controller.changed.clear()
            try:
                self._paint(self._controller.state, self._controller.now())
            except Exception as error:
                self._report(error)
            moving = self._controller.state.pending is not None
            self._ended.wait(_PERIOD_S)
            self._controller.changed.wait(0.0 if moving else _IDLE_S)

    def _report(self, error: Exception) -> None:
        """Report an error of painting once: it must not stop the painter, nor go unseen."""
        text = f"{type(error).__name__}: {error}"
        if text != self._failed:
            self._failed = text
            _log.exception("The console could not paint a message.")
            self._controller.show(
                Fault(id=fresh_id("fault"), time_s=self._controller.now(), where="console", text=text)
            )
