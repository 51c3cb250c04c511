"""Signals by which a system ends a program: all of them end it in order, as Ctrl-C does."""

import signal
import threading
from collections.abc import Generator
from contextlib import contextmanager
from types import FrameType
from typing import Final, final

_SYSTEM: Final = (signal.SIGTERM, signal.SIGHUP, signal.SIGXCPU)
"""`kill`, `docker stop`, systemd and shutdown; a terminal or a connection that is gone; the end of a time limit."""
_SHELL: Final = 128
"""Shells report a program that a signal ended with this much more than the signal's number."""
_ALONE_S: Final = 15
"""Longest time in which a child process that was told to end waits for its parent to end it."""


@final
class EndingSignal:
    """The signal that ends this program: SIGINT, Ctrl-C, unless the system sent another one first."""

    def __init__(self) -> None:
        self.number = signal.SIGINT

    @property
    def text(self) -> str:
        """The reason of the end, for the last line that the program prints."""
        return "interrupted" if self.number == signal.SIGINT else f"ended by {self.number.name}"

    @property
    def exit_code(self) -> int:
        """Exit code of the program."""
        return _SHELL + self.number


@contextmanager
def system_interrupts() -> Generator[EndingSignal]:
    """While open, the first signal of the system interrupts the main thread as Ctrl-C does; later ones do nothing more.

    A signal that is ignored already, as SIGHUP is under `nohup`, stays so. Python lets the main thread alone take
    signals: opened in another one, it does nothing.
    """
    ending = EndingSignal()
    if threading.current_thread() is not threading.main_thread():
        yield ending
        return

    def end(number: int, _frame: FrameType | None) -> None:
        if ending.number != signal.SIGINT:
            return
        ending.number = signal.Signals(number)
        # The event loop has a handler of its own, which lets all tasks end in order.
        if callable(signal.getsignal(signal.SIGINT)):
            signal.raise_signal(signal.SIGINT)
        else:  # Shells have their background jobs ignore Ctrl-C.
            raise KeyboardInterrupt

    taken = [number for number in _SYSTEM if signal.getsignal(number) is signal.SIG_DFL]
    for number in taken:
        signal.signal(number, end)
    try:
        yield ending
    finally:
        for number in taken:
            signal.signal(number, signal.SIG_DFL)


def leave_end_to_parent() -> None:
    """Have this child process go on when a whole group of processes is told to end: its parent ends it in order.

    It ends by itself only if the parent has not done so in time. To be called in its main thread.
    """
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    for number in _SYSTEM:
        signal.signal(number, _end_later)


def _end_later(_number: int, _frame: FrameType | None) -> None:
    signal.alarm(_ALONE_S)
