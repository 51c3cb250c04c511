"""One fault at a time, and when the arm was at rest after it by its own process's clock."""

import os
import signal
import time
from collections.abc import Callable, Generator, Mapping
from contextlib import contextmanager, suppress
from dataclasses import dataclass
from typing import Any, Final, Protocol, TypeAlias, final

import numpy as np
import psutil

from app.arm.memory import MODES, ArmMemory
from app.arm.process import Controlled
from app.config import Limits, Site
from app.core.system.ring import SPAWN
from bench.faults.application import FAULTS, Doing, application

Motion: TypeAlias = tuple[np.ndarray, np.ndarray]
"""Times [s] in order, and how fast the tool was at each of them [m/s]."""
Others: TypeAlias = Mapping[str, Callable[[], None]]
"""Faults by name, and how each is done."""


class Truth(Protocol):
    """Ground truth of the arm, independent of its process."""

    def motion(self) -> Motion:
        """Recent motion of the tool."""
        ...

    def within(self, since_s: float) -> bool:
        """True if all commands to the arm and its motion since then [s] kept to the limits."""
        ...


_FAST: Final = 0.5
"""A fault comes while the tool moves at least as fast as this share of the limit."""
_REST_M_S: Final = 1e-3
_WATCHED_S: Final = 0.6
"""Time after a fault in which the arm's states are checked: it must not begin to move again by itself."""
_START_S: Final = 60.0
_POLL_S: Final = 0.005
_HUNG_S: Final = 0.3
_BEFORE_S: Final = 5.0
"""Time before a fault whose commands and motion are checked as well."""


@final
@dataclass(frozen=True, kw_only=True)
class Outcome:
    """Outcome of a fault. `rest_ms`: from the fault to rest; infinite if it took too long."""

    fault: str
    doing: Doing
    rest_ms: float
    speed_m_s: float
    within: bool
    """True if no command since the beginning left the limits."""


@final
class Subject:
    """An application with its arm, to which faults are done while the arm moves."""

    def __init__(self, doing: Doing, site: Site, take: Controlled, others: Others, truth: Truth | None = None) -> None:
        self.doing: Doing = doing
        self._site, self._take, self._others, self._truth = site, take, others, truth
        self._begin()

    def suffer(self, fault: str) -> Outcome:
        """Wait until the tool is fast, do it, and see when it is at rest; the application is well again afterwards."""
        speed_m_s = self.wait_until_fast()
        seen = max(self.memory.states.count - 1, 0)
        fault_s = time.monotonic()
        kept_on = None
        if fault in self._others:
            self._others[fault]()
        elif fault in _OUTSIDE:
            kept_on = _OUTSIDE[fault](self)
        else:
            self.tell(fault)
        time.sleep(max(0.0, fault_s + _WATCHED_S - time.monotonic()))
        # Who does not run can notice nothing; what an arm does by itself it does meanwhile. An application that is told
        # to do something wrong does it a little later, on a busy machine by tens of milliseconds.
        since_s = max(fault_s, self._done_s.value) if kept_on is None or self._truth is not None else kept_on
        times_s, speeds = self._truth.motion() if self._truth else motion(self.memory.states.since(seen))
        outcome = Outcome(
            fault=fault,
            doing=self.doing,
            rest_ms=1e3 * (came_to_rest(times_s, speeds, since_s) - since_s),
            speed_m_s=speed_m_s,
            within=kept(self.memory.states.since(0), self._site.limits)
            and (self._truth is None or self._truth.within(fault_s - _BEFORE_S)),
        )
        self._recover()
        return outcome

    def stops(self, seconds: float) -> list[str]:
        """Why the arm stopped in so long, once for each time."""
        found, seen, rests = list[str](), self.memory.states.count, False
        until_s = time.monotonic() + seconds
        while time.monotonic() < until_s:
            time.sleep(1.0)
            for state in self.memory.states.since(seen):
                seen, before = seen + 1, rests
                rests = MODES[state["mode"]] in ("stopping", "stopped", "fault")
                if rests and not before:
                    found.append(bytes(state["reason"]).decode(errors="ignore"))
        return found

    def end(self) -> None:
        """End both processes."""
        self.memory.closing.value = 1
        if self.process.is_alive():
            os.kill(self.pid, signal.SIGCONT)
            self.process.kill()
        self.process.join()

    @property
    def pid(self) -> int:
        """The application's."""
        assert self.process.pid is not None
        return self.process.pid

    @property
    def arm_pid(self) -> int:
        """The arm's process's."""
        (arm,) = (child for child in psutil.Process(self.pid).children() if "spawn_main" in " ".join(child.cmdline()))
        return arm.pid

    def tell(self, name: str) -> None:
        """Inject the fault into the application."""
        self._outbox.send(name)

    def _begin(self) -> None:
        self.memory = ArmMemory()
        goal_upload, self._outbox = SPAWN.Pipe(duplex=False)
        self._done_s = SPAWN.Value("d", 0.0)
        arguments = (self.memory, self._site, self._take, goal_upload, self._done_s, self.doing)
        self.process = SPAWN.Process(target=application, args=arguments)
        self.process.start()

    def _recover(self) -> None:
        """Have it move again: as it is, or started anew where it is gone."""
        if self.process.is_alive() and not self.memory.closing.value:
            with suppress(BrokenPipeError):  # It is about to end: a busy machine takes its time.
                self.tell("again")
                return
        self.end()
        self._begin()

    def wait_until_fast(self) -> float:
        """Wait until the tool moves, and return its speed [m/s]."""
        until_s = time.monotonic() + _START_S
        while time.monotonic() < until_s and self.process.is_alive():
            newest = self.memory.states.newest()
            if newest is not None:
                speed_m_s = float(np.linalg.norm(newest["velocity"]))
                if speed_m_s > _FAST * self._site.limits.speed_m_s and MODES[newest["mode"]] == "moving":
                    return speed_m_s
            time.sleep(_POLL_S)
        newest = self.memory.states.newest()
        said = "" if newest is None else f"{MODES[newest['mode']]}: {bytes(newest['reason']).decode()}"
        raise AssertionError(f"The tool does not move; exit code {self.process.exitcode}; {said}")


@contextmanager
def subject(
    doing: Doing, site: Site, take: Controlled, others: Others | None = None, truth: Truth | None = None
) -> Generator[Subject]:
    """One that has ended when it is left. `others`: faults of the arm itself."""
    opened = Subject(doing, site, take, others or {}, truth)
    try:
        yield opened
    finally:
        opened.end()


def faults(doing: Doing) -> tuple[str, ...]:
    """Every fault that can be injected meanwhile."""
    return (*FAULTS[doing], *_OUTSIDE)


def kept(states: Any, limits: Limits) -> bool:
    """True if all commands kept to workspace and speed; a tick that comes late covers its whole time."""
    places, times = states["commanded"][:, :3], states["time_s"]
    gone = np.linalg.norm(places[10:] - places[:-10], axis=1)
    slow = gone <= limits.speed_m_s * np.maximum(times[10:] - times[:-10], 0.0) * 1.01 + 1e-6
    return limits.workspace.contains(places) and bool(slow.all())


def rest_s(states: Any) -> float:
    """Time at which the arm came to rest, by its process's log that begins with a fault."""
    times_s, speeds = motion(states)
    return came_to_rest(times_s, speeds, float(times_s[0]))


def motion(states: Any) -> Motion:
    """Motion as measured by the arm's process."""
    return states["time_s"], np.linalg.norm(states["velocity"], axis=1)


def came_to_rest(times_s: np.ndarray, speeds: np.ndarray, since_s: float) -> float:
    """Time from which on the tool was at rest; infinite if it moved at the last of the times."""
    fast = np.flatnonzero((speeds > _REST_M_S) & (times_s >= since_s))
    if not len(fast):
        return since_s
    return float(times_s[fast[-1] + 1]) if fast[-1] + 1 < len(times_s) else float("inf")


def _kill(subject: Subject) -> None:
    os.kill(subject.pid, signal.SIGKILL)


def _terminate(subject: Subject) -> None:
    os.kill(subject.pid, signal.SIGTERM)


def _freeze(subject: Subject) -> None:
    """Stop the application's process, and let it go on after the arm has been watched."""
    os.kill(subject.pid, signal.SIGSTOP)
    time.sleep(_WATCHED_S)
    os.kill(subject.pid, signal.SIGCONT)


def _hang_arm(subject: Subject) -> float:
    """Stop the arm's own process for a while; when it went on [s], which is when it can notice."""
    pid = subject.arm_pid
    os.kill(pid, signal.SIGSTOP)
    time.sleep(_HUNG_S)
    on_s = time.monotonic()
    os.kill(pid, signal.SIGCONT)
    return on_s


def _close(subject: Subject) -> None:
    """The rig is closed in the middle."""
    subject.memory.closing.value = 1


_OUTSIDE: Mapping[str, Callable[[Subject], float | None]] = {
    "kill": _kill,
    "terminate": _terminate,
    "freeze": _freeze,
    "hang the arm": _hang_arm,
    "close": _close,
}
"""Faults injected into a process from outside."""
