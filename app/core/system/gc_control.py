"""Control of Python's garbage collector, so that it does not pause a real-time loop."""

import gc
from collections.abc import Generator
from contextlib import contextmanager
from typing import Final

_open: Final = list[None]()
"""One entry for each open block of `spared_collection`."""


@contextmanager
def spared_collection() -> Generator[None]:
    """While open, a full collection skips every object that existed before.

    Traversing the objects of the libraries (2e5 and more) holds every thread of the process for 50 to 250 ms, longer
    than the arm's watchdog waits. The outermost of nested blocks ends it.
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
    """While open, no cyclic garbage is collected: for seconds in which nothing may pause, not for longer."""
    collects = gc.isenabled()
    gc.disable()
    try:
        yield
    finally:
        if collects:
            gc.enable()
