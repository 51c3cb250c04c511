"""A whole application driven from outside: commanded, its messages read, watched, and its log read afterwards."""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Generator
from contextlib import contextmanager, suppress
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any, Final, final

import numpy as np
import psutil

from app.arm.memory import MODES
from app.core.dialogue.control import ModeName
from bench.faults.witness import witnessed

_ROOT: Final = Path(__file__).parent.parent.parent
PATIENCE_S: Final = 240.0
"""Timeout of every wait: the machine may be loaded, and the first process takes its time to load."""
_FAST_M_S: Final = 0.12
_POLL_S: Final = 0.01
_AGAIN_S: Final = 3.0
"""Period of pressing Resume again."""


@final
class Driven:
    """One running application. Its `shown` messages are kept in the order in which they came."""

    def __init__(self, folder: Path, *options: str) -> None:
        self.folder, self.shown = folder, list[dict[str, Any]]()
        self.recording = Path()
        self._changed = threading.Condition()
        self._errors = (folder / "stderr").open("w+")
        self._process = subprocess.Popen(
            [sys.executable, "-m", "bench.faults.whole", str(folder), *options],
            cwd=_ROOT,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=self._errors,
            text=True,
            env=os.environ | {"OPENBLAS_NUM_THREADS": "1"},
        )
        self._listening = threading.Thread(target=self._listen, daemon=True)
        self._listening.start()

    @property
    def pid(self) -> int:
        """Process id of the application itself."""
        return self._process.pid

    @property
    def ended(self) -> bool:
        """True if it has exited."""
        return self._process.poll() is not None

    def order(self, order: str, **told: object) -> None:
        """Send it a command of `Orders`."""
        assert self._process.stdin is not None
        with suppress(BrokenPipeError):
            self._process.stdin.write(json.dumps({"order": order, **told}) + "\n")
            self._process.stdin.flush()

    def wait(
        self, kind: str, says: str = "", *, after_s: float = 0.0, within_s: float = PATIENCE_S
    ) -> dict[str, Any] | None:
        """The first message of a kind, or other event, that came `after_s` and has these words; None where it ends."""
        until_s, read = time.monotonic() + within_s, 0
        while True:
            with self._changed:
                if read == len(self.shown):
                    left_s = until_s - time.monotonic()
                    if left_s <= 0:
                        raise AssertionError(f"No {kind} {says!r} for {within_s:.0f} s; {self.errors()}")
                    self._changed.wait(min(left_s, 0.2))
                new, read = self.shown[read:], len(self.shown)
            for each in new:
                named = each.get("kind") == kind or each["event"] == kind
                if named and each["now_s"] >= after_s and says in each.get("words", ""):
                    return each
            if not new and self.ended and not self._listening.is_alive():
                return None

    def heard(self, kind: str, *, after_s: float) -> list[dict[str, Any]]:
        """All messages of a kind that came `after_s`."""
        with self._changed:
            return [each for each in self.shown if each.get("kind") == kind and each["now_s"] >= after_s]

    def process_id(self, name: str) -> int:
        """Process id of a process of the application, by its name; 0 if there is none now."""
        if name == "application":
            return self.pid
        asked_s = time.monotonic()
        self.order("processes")
        told = self.wait("processes", after_s=asked_s)
        return int(told["pids"].get(name, 0)) if told else 0

    def states(self, newest: int | None = None) -> Any:
        """All states of the arm so far, or the `newest` so many."""
        path = self.folder / "states"
        return witnessed(path, newest) if path.exists() else None

    def fast(self, since_s: float) -> bool:
        """True if the arm moves fast now, by a state newer than `since_s`."""
        states = self.states(newest=1)
        if states is None or not len(states):
            return False
        newest = states[-1]
        quick = float(np.linalg.norm(newest["velocity"])) > _FAST_M_S
        return quick and MODES[newest["mode"]] == "moving" and float(newest["time_s"]) > since_s

    def insists(self, mode: ModeName, done: Callable[[float], bool]) -> bool:
        """Repeat the mode's activity until it is `done` (given its start); Resume is pressed after a stop.

        A machine that is too busy stops the arm as well, so that a person may have to press it more than once. False
        where the application ends instead.
        """
        until_s = time.monotonic() + PATIENCE_S
        since_s = due_s = -np.inf
        while time.monotonic() < until_s and not self.ended:
            now_s = time.monotonic()
            stopped = MODES[self.states(newest=1)[-1]["mode"]] == "stopped"
            if since_s < 0 or (now_s > due_s and (stopped or self._idle(mode, since_s))):
                self._begins(mode)
                since_s, due_s = now_s, now_s + _AGAIN_S
            if done(since_s):
                return True
            time.sleep(_POLL_S)
        if self.ended:
            return False
        raise AssertionError(f"It did not do what it does in the mode {mode} for {PATIENCE_S:.0f} s; {self.errors()}")

    def _begins(self, mode: ModeName) -> None:
        """Resume, and start the mode anew."""
        self.order("release")
        self.order("resume")
        self.order("mode", mode="idle")
        self.order("mode", mode=mode)

    def _idle(self, mode: ModeName, since_s: float) -> bool:
        """True if it has left the mode by itself."""
        modes = self.heard("Mode", after_s=since_s)
        return bool(modes) and mode not in modes[-1]["words"]

    def errors(self) -> str:
        """Text of its stderr, and its last messages."""
        self._errors.flush()
        text = (self.folder / "stderr").read_text()[-2000:]
        with self._changed:
            last = [f"{each.get('kind', each['event'])} {each.get('words', '')}" for each in self.shown[-8:]]
        return f"it ended with {self._process.poll()}, said {last}, and wrote {text!r}"

    def join(self) -> dict[str, Any] | None:
        """Wait for its exit: its last message, or None."""
        self._process.wait(PATIENCE_S)
        self._listening.join(PATIENCE_S)
        with self._changed:
            return next((each for each in reversed(self.shown) if each["event"] == "ended"), None)

    def close(self) -> None:
        """End it in any case, with all that it started."""
        with suppress(psutil.NoSuchProcess):
            children = psutil.Process(self.pid).children(recursive=True) if not self.ended else []
            for each in (psutil.Process(self.pid), *children):
                with suppress(psutil.NoSuchProcess):
                    each.send_signal(signal.SIGCONT)
            self._process.kill()
            _, left = psutil.wait_procs(children, timeout=10.0)
            for each in left:
                each.kill()
        self._process.wait()
        self._listening.join(PATIENCE_S)
        for stream in (self._process.stdin, self._process.stdout, self._errors):
            if stream is not None:
                with suppress(BrokenPipeError):
                    stream.close()

    def _listen(self) -> None:
        assert self._process.stdout is not None
        for line in self._process.stdout:
            with suppress(ValueError):
                said: dict[str, Any] = json.loads(line)
                with self._changed:
                    if said["event"] == "begun":
                        self.recording = Path(said["recording"])
                    self.shown.append(said)
                    self._changed.notify_all()


@contextmanager
def driven(*options: str) -> Generator[Driven]:
    """One that has ended when it is left."""
    with TemporaryDirectory() as folder:
        one = Driven(Path(folder), *options)
        try:
            yield one
        finally:
            one.close()
