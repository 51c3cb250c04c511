"""The processes of a rig: started together, waited for until each has reported once, and ended in any case."""

import contextlib
import os
import sys
import time
from collections.abc import Callable, Sequence
from multiprocessing import current_process
from multiprocessing.process import BaseProcess
from typing import Final

import anyio

from app.core.errors import DeviceError, DipacError
from app.core.ring import SPAWN, Ring

_START_S: Final = 60.0
_POLL_S: Final = 0.02
_CLOSE_S: Final = 3.0


def process(name: str, body: Callable[..., None], *arguments: object) -> BaseProcess:
    """One that is to run `body`; it ends with the program, and is `dipac NAME` where processes are listed."""
    return SPAWN.Process(target=_run, args=(body, *arguments), name=f"dipac {name}", daemon=True)


def _run(body: Callable[..., None], *arguments: object) -> None:
    """An error of this program's own is a sentence for whoever started it, and not a stack."""
    try:
        body(*arguments)
    except DipacError as error:
        sys.stderr.write(f"{current_process().name}: {error}\n")
        raise SystemExit(error.exit_code) from None


def ask_for_real_time() -> None:
    """Run before all ordinary processes where the system allows it, as an arm's controller does; for its body to call.

    So do the threads that it starts. Without the right to it (CAP_SYS_NICE) a loop still wakes in time as a rule,
    because it uses so little.
    """
    with contextlib.suppress(PermissionError):
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))


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
    """Wait for processes that have been told to close, and end those that do not. Blocks for as long as that takes."""
    due_s = time.monotonic() + within_s
    for each in processes:
        if each.pid is None:
            continue
        each.join(max(0.0, due_s - time.monotonic()))
        if each.is_alive():
            each.kill()
            each.join()
