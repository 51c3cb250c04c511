"""Worker processes for heavy computation, so that the event loop never waits for a compiler or a solver."""

import multiprocessing
import os
import pickle
import signal
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, Self, TypeVar, cast, final

import anyio
from anyio import to_thread

from app.core.errors import WorkerError

ResultT = TypeVar("ResultT")

_SPAWN = multiprocessing.get_context("spawn")


@final
class Worker(AbstractAsyncContextManager["Worker"]):
    """One process that runs one pure function at a time and keeps its compiled state between calls.

    `niceness` is added to its scheduling priority: planners yield to the arm and the cameras. A call that is cancelled
    ends the process, and so does closing; the next call starts a fresh one.
    """

    def __init__(self, name: str, *, niceness: int = 0) -> None:
        self.name = name
        self._niceness = niceness
        self._process: SpawnProcess | None = None
        self._connection: Connection[Any, Any] | None = None
        self._turn = anyio.Lock()

    async def __aenter__(self) -> Self:
        return self

    async def __aexit__(self, *_: object) -> None:
        with anyio.CancelScope(shield=True):
            await to_thread.run_sync(self._end)

    async def run(self, function: Callable[..., ResultT], *arguments: object) -> ResultT:
        """`function(*arguments)` in the worker; both must be picklable.

        Raises what the function raises, or WorkerError where the process died.
        """
        async with self._turn:
            try:
                succeeded, value = await to_thread.run_sync(self._call, function, arguments, abandon_on_cancel=True)
            except anyio.get_cancelled_exc_class():
                with anyio.CancelScope(shield=True):
                    await to_thread.run_sync(self._end)
                raise
        if not succeeded:
            raise cast(BaseException, value)
        return cast(ResultT, value)

    def _call(self, function: Callable[..., object], arguments: tuple[object, ...]) -> tuple[bool, object]:
        if self._process is None or not self._process.is_alive():
            self._start()
        process, connection = self._process, self._connection
        assert process is not None
        assert connection is not None
        try:
            connection.send((function, arguments))
            return cast(tuple[bool, object], connection.recv())
        except (EOFError, BrokenPipeError, ConnectionResetError):
            process.join(timeout=1.0)
            self._process = None
            raise WorkerError(
                f"The {self.name} process ended with code {process.exitcode} while computing; a fresh one starts with "
                "the next call. If this repeats, memory may be short: see `dipac doctor`."
            ) from None

    def _start(self) -> None:
        ours, theirs = _SPAWN.Pipe()
        process = _SPAWN.Process(target=_serve, args=(theirs, self._niceness), name=f"dipac {self.name}", daemon=True)
        process.start()
        theirs.close()
        self._process, self._connection = process, ours

    def _end(self) -> None:
        if self._process is not None:
            self._process.kill()
            self._process.join()
            self._process = None
        if self._connection is not None:
            self._connection.close()
            self._connection = None


def _serve(connection: "Connection[Any, Any]", niceness: int) -> None:
    """Answer calls until the parent closes its end or dies."""
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(niceness)
    while True:
        try:
            function, arguments = connection.recv()
        except (EOFError, OSError):
            return
        try:
            answer: tuple[bool, object] = (True, function(*arguments))
        except Exception as error:
            answer = (False, _portable(error))
        connection.send(answer)


def _portable(error: Exception) -> Exception:
    """`error`, or a WorkerError with its text where it cannot cross the pipe."""
    try:
        pickle.loads(pickle.dumps(error))  # noqa: S301 - our own bytes
    except Exception:
        return WorkerError(f"{type(error).__name__}: {error}")
    return error
