"""Time as the flow has it."""

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
