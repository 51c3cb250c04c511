"""The processes of a rig: started together, waited for until each has reported once, and ended in any case."""

import contextlib
import os
import sys
import time
from collections.abc import Callable, Generator, Sequence
from multiprocessing import current_process
from multiprocessing.process import BaseProcess
from pathlib import Path
from typing import Final

import anyio

from app.core.errors import DeviceError, DipacError
from app.core.system.ring import SPAWN, Ring
from app.core.system.signals import leave_end_to_parent

_START_S: Final = 60.0
_POLL_S: Final = 0.02
_CLOSE_S: Final = 3.0
_ARM_PRIORITY, _APPLICATION_PRIORITY = 2, 1
"""Priorities in the real-time round-robin class; the greater runs first."""


def process(name: str, body: Callable[..., None], *arguments: object) -> BaseProcess:
    """A process that will run `body`; it ends with the program, and is listed as `dipac NAME`."""
    return SPAWN.Process(target=_run, args=(body, *arguments), name=f"dipac {name}", daemon=True)


def _run(body: Callable[..., None], *arguments: object) -> None:
    """Run `body`; print an error of this program as one sentence, not as a stack trace."""
    leave_end_to_parent()
    try:
        body(*arguments)
    except DipacError as error:
        sys.stderr.write(f"{current_process().name}: {error}\n")
        raise SystemExit(error.exit_code) from None


def ask_for_real_time() -> None:
    """Give the calling process real-time priority where the system allows it; for its body to call.

    The threads that it starts inherit it. Without the right to it (CAP_SYS_NICE) a control loop still wakes in time as
    a rule, because it uses so little.
    """
    with contextlib.suppress(OSError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(_ARM_PRIORITY))


@contextlib.contextmanager
def in_real_time() -> Generator[None]:
    """While open, run this process in real time, below the arm's priority, where the system allows it.

    It covers all of its threads, later ones too: a thread that waits for a core may hold the interpreter's lock, and
    the event loop would wait with it. Beside a browser that renders in software and a busy program, an event loop of
    ordinary priority waited for a core for 100 to 450 ms at a time, while it needed one for less than a millisecond; an
    arm's watchdog waits 160. Child processes are ordinary ones, by `start_ordinary`.
    """
    _schedule_threads(os.SCHED_RR, _APPLICATION_PRIORITY)
    try:
        yield
    finally:
        _schedule_threads(os.SCHED_OTHER, 0)


def may_run_in_real_time() -> bool:
    """True where the system allows this process real-time priority; the calling thread stays an ordinary one."""
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(_APPLICATION_PRIORITY))
    except OSError:  # A sandbox may not know the call at all.
        return False
    os.sched_setscheduler(0, os.SCHED_OTHER, os.sched_param(0))
    return True


def start_ordinary(process: BaseProcess) -> None:
    """Start a process of ordinary priority, also from a real-time thread."""
    policy, parameters = os.sched_getscheduler(0), os.sched_getparam(0)
    if policy != os.SCHED_RR:
        process.start()
        return
    os.sched_setscheduler(0, policy | os.SCHED_RESET_ON_FORK, parameters)
    try:
        process.start()
    finally:
        with contextlib.suppress(OSError):  # A process that may set the flag may not always be allowed to clear it.
            os.sched_setscheduler(0, policy, parameters)


def _schedule_threads(policy: int, priority: int) -> None:
    """Set the scheduling policy of all existing threads of this process."""
    for thread in Path("/proc/self/task").iterdir():
        with contextlib.suppress(OSError):
            os.sched_setscheduler(int(thread.name), policy, os.sched_param(priority))


async def ready(processes: Sequence[BaseProcess], rings: Sequence[Ring], *, within_s: float = _START_S) -> None:
    """Wait until every ring has a record, which its process writes once it works.

    Raises DeviceError where a process ends instead, or the time is over.
    """
    with anyio.move_on_after(within_s):
        while not all(ring.count for ring in rings):
            for each in processes:
                if not each.is_alive():
                    raise DeviceError(
                        f"The {each.name} process ended with code {each.exitcode} as it started; its error is above. "
                        "`dipac doctor` checks what it needs."
                    )
            await anyio.sleep(_POLL_S)
        return
    raise DeviceError(f"The rig did not come up in {within_s:.0f} s; the machine may be overloaded.")


def end(processes: Sequence[BaseProcess], *, within_s: float = _CLOSE_S) -> None:
    """Wait for processes that have been told to close, and kill those that do not. Blocks for as long as that takes."""
    due_s = time.monotonic() + within_s
    for each in processes:
        if each.pid is None:
            continue
        each.join(max(0.0, due_s - time.monotonic()))
        if each.is_alive():
            each.kill()
            each.join()
