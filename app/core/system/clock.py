"""The clock of the machine."""

import time
from typing import final

import anyio


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
