"""Needs of tests besides a core: tests without any run beside each other, the others one by one.

Tests say so by the fixtures they use, or by the mark `serial`; `undeclared` finds those that do not.
"""

import multiprocessing.util
import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

FIXTURES = frozenset({"anyio_backend", "browser_address", "served"})
"""Fixtures whose users have an event loop, a served console or a browser."""
VIRTUAL = "virtual_time"
"""Fixture whose users have an event loop that waits for nothing, which needs a core alone."""
_AUDITED = {
    "os.fork": "a process",
    "os.posix_spawn": "a process",
    "subprocess.Popen": "a process",
    "socket.bind": "a socket",
    "socket.connect": "a socket",
}
"""Events that the interpreter raises for these (PEP 578); Python 3.11 raises none for sleeps."""
_used: set[str] | None = None


def _hear(event: str, _: tuple[Any, ...]) -> None:
    if _used is not None and event in _AUDITED and not _is_importing():
        _used.add(_AUDITED[event])


def _is_importing() -> bool:
    """True while a library is imported: some look for processes or sockets then, as urllib3 does for IPv6."""
    frame = sys._getframe()
    while frame := frame.f_back:
        if frame.f_code.co_filename.startswith("<frozen importlib"):
            return True
    return False


sys.addaudithook(_hear)


@contextmanager
def undeclared() -> Iterator[set[str]]:
    """Processes, sockets and sleeps that are used meanwhile.

    Threads are not looked for: those of a pool compute, and who waits for one with a clock has to sleep or to serve.
    """
    global _used
    _used = used = set[str]()
    sleep, spawn = time.sleep, multiprocessing.util.spawnv_passfds

    def heard_sleep(seconds: float) -> None:
        used.add("a sleep")
        sleep(seconds)

    def heard_spawn(path: bytes, args: Sequence[Any], passfds: Sequence[int]) -> int:
        """Note a spawn of `multiprocessing`, which raises no audit event; the shared memory tracker does not count."""
        if not any("resource_tracker" in str(arg) for arg in args):
            used.add("a process")
        return spawn(path, args, passfds)

    time.sleep, multiprocessing.util.spawnv_passfds = heard_sleep, heard_spawn
    try:
        yield used
    finally:
        time.sleep, multiprocessing.util.spawnv_passfds = sleep, spawn
        _used = None
