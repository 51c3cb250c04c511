"""A process that records every state of the arm and outlives the application, for the arm's motion after it."""

import os
import signal
import time
from functools import cache
from pathlib import Path
from typing import Any, Final

import numpy as np

from app.arm.memory import ArmMemory

_PERIOD_S: Final = 0.02
_AFTER_S: Final = 1.5
"""An arm whose application is gone has rested by then."""


def witness(memory: ArmMemory, path: Path, parent: int) -> None:
    """The body of the process: append to `path` until the watched process is gone."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    seen, until_s = 0, float("inf")
    with path.open("wb") as file:
        while time.monotonic() < until_s:
            states = memory.states.since(seen)
            seen += len(states)
            file.write(states.tobytes())
            file.flush()
            if until_s == float("inf") and (memory.closing.value or os.getppid() != parent):
                until_s = time.monotonic() + _AFTER_S
            time.sleep(_PERIOD_S)


def witnessed(path: Path, newest: int | None = None) -> Any:
    """The states as far as they have been written down, oldest first, and those of the last write without its tail.

    `newest`: no more than so many, which who asks often reads faster than all.
    """
    dtype = _dtype()
    with path.open("rb") as file:
        count = file.seek(0, os.SEEK_END) // dtype.itemsize
        first = 0 if newest is None else max(0, count - newest)
        file.seek(first * dtype.itemsize)
        return np.frombuffer(file.read((count - first) * dtype.itemsize), dtype=dtype)


@cache
def _dtype() -> "np.dtype[np.void]":
    """Record of a state."""
    return ArmMemory().states.dtype
