"""Python's garbage collector, kept from pausing a loop that others rely on."""

import gc
from collections.abc import Generator
from contextlib import contextmanager
from typing import Final

_open: Final = list[None]()
"""One for each block that spares what was made before."""


@contextmanager
def spared_collection() -> Generator[None]:
    """While open, a full collection passes over all that was made before.

    Going through what the libraries leave (2e5 objects and more) holds every thread of the process for 50 to 250 ms,
    which is longer than the arm's watchdog waits. Of blocks in one another, the outermost ends it.
    """
    gc.collect()
    gc.freeze()
    _open.append(None)
    try:
        yield
    finally:
        _open.pop()
        if not _open:
            gc.unfreeze()


@contextmanager
def paused_collection() -> Generator[None]:
    """While open, no cycle of garbage is looked for: for seconds in which nothing may pause, not for longer."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()
