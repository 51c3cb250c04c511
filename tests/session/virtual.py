"""Virtual time: the loop's clock jumps to the next timer as soon as there is nothing else to do.

While a thread computes, the clock stands still, so that no deadline passes by what a machine takes to compute.
"""

import asyncio
import pickle
import selectors
from collections.abc import Callable
from typing import Any, final

import anyio
import pytest
from anyio import to_thread

from app.core.errors import DipacError, WorkerError
from app.core.system.worker import Worker

_BEGIN_S, _MOMENT_S = 1000.0, 1e-9


@final
class _Selector(selectors.DefaultSelector):
    """Waits in virtual time, but for threads."""

    def __init__(self) -> None:
        super().__init__()
        self.now_s = _BEGIN_S
        self.computing = 0

    def select(self, timeout: float | None = None) -> list[tuple[selectors.SelectorKey, int]]:
        if timeout is None or timeout <= 0:
            return super().select(timeout)
        if self.computing:
            return super().select(None)
        events = super().select(0)
        self.now_s += 0.0 if events else timeout
        return events


@final
class VirtualLoop(asyncio.SelectorEventLoop):
    """An event loop in virtual time, which begins at an arbitrary moment."""

    def __init__(self) -> None:
        self._waiting = _Selector()
        super().__init__(self._waiting)

    def time(self) -> float:
        # No two moments are the same, as in real time.
        self._waiting.now_s += _MOMENT_S
        return self._waiting.now_s

    def hang(self, duration_s: float) -> None:
        """Let time pass in which nothing is done, as where a call holds the loop."""
        self._waiting.now_s += duration_s

    async def compute(self, run: Callable[..., Any], *arguments: Any, **options: Any) -> Any:
        """Await `run`, a call in a thread, with time standing still."""
        self._waiting.computing += 1
        try:
            return await run(*arguments, **options)
        finally:
            self._waiting.computing -= 1


@final
class VirtualClock:
    """The time of the loop that runs where it is made: virtual, or the machine's in any other loop."""

    def __init__(self) -> None:
        self._loop = asyncio.get_running_loop()

    def now(self) -> float:
        return self._loop.time()

    async def sleep(self, duration_s: float) -> None:
        await anyio.sleep(duration_s)

    def move_on_after(self, duration_s: float | None) -> anyio.CancelScope:
        return anyio.move_on_after(duration_s)


class InsideWorker(Worker):
    """A worker that is a thread of this process: starting one, and what it computes, takes no time."""

    async def _answer(self, function: Callable[..., object], arguments: tuple[object, ...]) -> tuple[bool, object]:
        return await to_thread.run_sync(_answered, function, arguments)

    def _end(self) -> None:
        pass


def _answered(function: Callable[..., object], arguments: tuple[object, ...]) -> tuple[bool, object]:
    """Answer of a worker's process: call and result cross a pickle, and errors are returned."""
    try:
        call, given = pickle.loads(pickle.dumps((function, arguments)))
        return True, pickle.loads(pickle.dumps(call(*given)))
    except DipacError as error:
        return False, error
    except Exception as error:
        return False, WorkerError(repr(error))


def worker_here(name: str, **options: Any) -> Worker:
    """A worker for the loop that runs: a thread in virtual time, a process otherwise."""
    return (InsideWorker if is_virtual() else Worker)(name, **options)


def is_virtual() -> bool:
    """The loop that runs is one in virtual time."""
    return isinstance(asyncio.get_running_loop(), VirtualLoop)


def install(patch: pytest.MonkeyPatch) -> None:
    """In virtual time, wait for threads."""
    run_sync = to_thread.run_sync

    async def waited_for(*arguments: Any, **options: Any) -> Any:
        loop = asyncio.get_running_loop()
        if isinstance(loop, VirtualLoop):
            return await loop.compute(run_sync, *arguments, **options)
        return await run_sync(*arguments, **options)

    patch.setattr(to_thread, "run_sync", waited_for)
