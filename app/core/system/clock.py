"""The clock of the machine, and deadlines by it."""

import time
from typing import Final, final

import anyio

_LONGEST_POLL_S: Final = 0.5
"""Longest time between two polls that counts: a longer one is the machine's, which slept or was halted meanwhile."""


@final
class PollDeadline:
    """Deadline of a loop that polls: `after_s` from now, and later by the time in which the whole program stood still.

    A laptop that was closed, or a process that was halted, has not waited.
    """

    def __init__(self, after_s: float) -> None:
        self._left_s, self._last_s = after_s, time.monotonic()

    def is_over(self) -> bool:
        """True once the time is over; to be asked at each poll."""
        now_s = time.monotonic()
        self._left_s -= min(now_s - self._last_s, _LONGEST_POLL_S)
        self._last_s = now_s
        return self._left_s <= 0


@final
class SystemClock:
    """The machine's monotonic clock."""

    def now(self) -> float:
        """Monotonic time [s]."""
        return time.monotonic()

    async def sleep(self, duration_s: float) -> None:
        """Wait."""
        await anyio.sleep(duration_s)

    def move_on_after(self, duration_s: float | None) -> anyio.CancelScope:
        """Cancel scope with a deadline; None: it has none."""
        return anyio.move_on_after(duration_s)
