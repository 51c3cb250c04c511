"""Worker processes for heavy computation, so that the event loop never waits for a compiler or a solver."""

import multiprocessing
import os
import threading
import traceback
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from multiprocessing.connection import Connection
from multiprocessing.context import SpawnProcess
from typing import Any, Self, TypeVar, cast, final

import anyio
from anyio import to_thread

from app.core.errors import DipacError, WorkerError
from app.core.system.processes import start_ordinary
from app.core.system.signals import leave_end_to_parent

ResultT = TypeVar("ResultT")

_SPAWN = multiprocessing.get_context("spawn")


@final
class Worker(AbstractAsyncContextManager["Worker"]):
    """One process that runs one pure function at a time and keeps its compiled state between calls.

    `niceness` is added to its scheduling priority: planners yield to the arm and the cameras. A call that is cancelled
    or takes longer than `deadline_s` ends the process, and so does closing; the next call starts a fresh one.
    """

    def __init__(self, name: str, *, niceness: int = 0, deadline_s: float = 600.0) -> None:
        self.name = name
        self._niceness = niceness
        self._deadline_s = deadline_s
        self._process: SpawnProcess | None = None
        self._connection: Connection[Any, Any] | None = None
        self._turn = anyio.Lock()
        # A cancelled call leaves its thread behind, which may still be starting a process or waiting for one.
        self._changing = threading.Lock()
        self._closed = False

    async def __aenter__(self) -> Self:
        self._closed = False
        return self

    async def __aexit__(self, *_: object) -> None:
        self._closed = True
        with anyio.CancelScope(shield=True):
            await to_thread.run_sync(self._end)

    async def run(self, function: Callable[..., ResultT], *arguments: object) -> ResultT:
        """`function(*arguments)` in the worker; both must be picklable.

        Raises the DipacError that the function raises, and WorkerError where it raises anything else (its traceback
        goes to stderr), the process died, or the deadline passed.
        """
        async with self._turn:
            with anyio.move_on_after(self._deadline_s):
                succeeded, value = await self._answer(function, arguments)
                if not succeeded:
                    raise cast(BaseException, value)
                return cast(ResultT, value)
        raise WorkerError(
            f"The {self.name} process had no answer after {self._deadline_s:.0f} s and was ended; a fresh one starts "
            "with the next call."
        )

    async def _answer(self, function: Callable[..., object], arguments: tuple[object, ...]) -> tuple[bool, object]:
        try:
            return await to_thread.run_sync(self._call, function, arguments, abandon_on_cancel=True)
        except anyio.get_cancelled_exc_class():
            with anyio.CancelScope(shield=True):
                await to_thread.run_sync(self._end)
            raise

    def _call(self, function: Callable[..., object], arguments: tuple[object, ...]) -> tuple[bool, object]:
        process, connection = self._running()
        try:
            connection.send((function, arguments))
            return cast(tuple[bool, object], connection.recv())
        except (EOFError, OSError):
            process.join(timeout=1.0)
            with self._changing:
                if self._process is process:
                    self._process = None
            raise WorkerError(
                f"The {self.name} process ended with code {process.exitcode} while computing; a fresh one starts with "
                "the next call. If this repeats, memory may be short: see `dipac doctor`."
            ) from None

    def _running(self) -> "tuple[SpawnProcess, Connection[Any, Any]]":
        """The process, started where there is none."""
        with self._changing:
            if self._closed:
                raise WorkerError(f"The {self.name} process is being closed.")
            if self._process is None or self._connection is None or not self._process.is_alive():
                self._connection, theirs = _SPAWN.Pipe()
                self._process = _SPAWN.Process(
                    target=_serve,
                    args=(theirs, self._niceness),
                    name=f"dipac {self.name}",
                    daemon=True,
                )
                start_ordinary(self._process)
                theirs.close()
            return self._process, self._connection

    def _end(self) -> None:
        with self._changing:
            if self._process is not None:
                self._process.kill()
                self._process.join()
                self._process = None
            if self._connection is not None:
                self._connection.close()
                self._connection = None


def _serve(connection: "Connection[Any, Any]", niceness: int) -> None:
    """Answer calls until the parent closes its end or dies."""
    leave_end_to_parent()
    os.nice(niceness)
    while True:
        try:
            function, arguments = connection.recv()
        except (EOFError, OSError):
            return
        try:
            answer: tuple[bool, object] = (True, function(*arguments))
        except DipacError as error:
            answer = (False, error)
        except Exception as error:
            answer = (False, WorkerError("".join(traceback.format_exception_only(error)).strip()))
            traceback.print_exc()
        try:
            connection.send(answer)
        except OSError:  # The parent is gone.
            return
