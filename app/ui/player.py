"""State of a replay: its moment and speed, changed by the buttons and shown by the painter. Knows no widget."""

import math
import threading
from bisect import bisect_left, bisect_right
from collections.abc import Callable
from dataclasses import dataclass
from typing import Final, Literal, NamedTuple, final

from app.core.messages import Message
from app.recording.read.event_index import Mark
from app.ui.replanning import Replanned, ReplanRequest

FASTEST: Final = math.inf
"""Speed limited only by reading the recording."""
STRIDE_S: Final = 1.0
"""Stride [s] of the recording between updates at that speed."""
_HERE_S: Final = 1e-6
"""Tolerance within which a moment is the current one, for a step."""


@final
@dataclass(frozen=True, kw_only=True)
class Reel:
    """A recording from its player's view: `clock` gives the recorded monotonic time [s] of a moment [s]."""

    name: str
    duration_s: float
    marks: tuple[Mark, ...]
    models: tuple[str, ...]
    clock: Callable[[float], float]

    @property
    def motions(self) -> tuple[Mark, ...]:
        """Starts of motions, in order."""
        return tuple(mark for mark in self.marks if mark.kind == "motion")


class Where(NamedTuple):
    """The moment [s] shown, and its progress; `jumped`: True for a jump since the last call.

    `besides`: messages to show along with the recorded ones, where the moment was planned again.
    """

    time_s: float
    playing: bool
    speed: float
    jumped: bool = False
    besides: tuple[Message, ...] = ()


@final
class Player:
    """Thread-safe player; no method blocks. Begins paused at `time_s`."""

    def __init__(self, reel: Reel, *, time_s: float = 0.0, speed: float = 1.0, model: str = "") -> None:
        self.reel, self.model = reel, model
        self._lock = threading.Lock()
        self._time_s = min(max(time_s, 0.0), reel.duration_s)
        self._speed, self._playing, self._jumped = speed, False, True
        self._besides: tuple[Message, ...] = ()
        self._order: ReplanRequest | None = None
        self.said = ""
        """Progress of planning again, in words."""
        self.replanned: Replanned | None = None

    @property
    def where(self) -> Where:
        """The current moment and speed."""
        with self._lock:
            return Where(self._time_s, self._playing, self._speed)

    def now(self) -> float:
        """Recorded clock [s]."""
        return self.reel.clock(self._time_s)

    def toggle(self) -> None:
        """Play, from the beginning where the end is reached, or pause."""
        with self._lock:
            if not self._playing and self._time_s >= self.reel.duration_s:
                self._go(0.0)
            self._playing = not self._playing

    def pause(self) -> None:
        """Pause here."""
        with self._lock:
            self._playing = False

    def set_speed(self, speed: float) -> None:
        """Set the recorded seconds per second."""
        with self._lock:
            self._speed = speed

    def jump(self, time_s: float) -> None:
        """Jump to a moment, and go on from there if it was playing."""
        with self._lock:
            self._go(time_s)

    def step(self, way: Literal[-1, 1]) -> None:
        """Jump to the next motion's start, or the previous one's, and pause; no jump where there is none."""
        starts = [mark.time_s for mark in self.reel.motions]
        with self._lock:
            later, earlier = bisect_right(starts, self._time_s + _HERE_S), bisect_left(starts, self._time_s - _HERE_S)
            index = later if way > 0 else earlier - 1
            if 0 <= index < len(starts):
                self._go(starts[index])
                self._playing = False

    def advance(self, elapsed_s: float) -> Where:
        """Advance by real time; returns the moment to show."""
        with self._lock:
            if self._playing:
                if self._besides:  # The new plan has no part in the recorded continuation.
                    self._go(self._time_s)
                further_s = STRIDE_S if self._speed == FASTEST else elapsed_s * self._speed
                self._time_s = min(self._time_s + further_s, self.reel.duration_s)
                self._playing = self._time_s < self.reel.duration_s
            where = Where(self._time_s, self._playing, self._speed, self._jumped, self._besides)
            self._jumped = False
            return where

    def order(self, order: ReplanRequest) -> None:
        """Request another plan, unless one is being made."""
        with self._lock:
            if self._order is None:
                self._order, self._playing = order, False
                self.said, self.replanned = "Starting the planner.", None

    def pending_request(self) -> ReplanRequest | None:
        """The requested plan, waiting or being made."""
        return self._order

    def tell(self, said: str) -> None:
        """Set the status of the order."""
        with self._lock:
            self.said = said

    def answer(self, said: str, replanned: Replanned | None = None) -> None:
        """Set the result of the order, and jump to its moment. Another may be requested now."""
        with self._lock:
            order, self._order = self._order, None
            self.said, self.replanned = said, replanned
            if order and replanned:
                self._go(order.time_s)
                self._playing, self._besides = False, (replanned.again,)

    def _go(self, time_s: float) -> None:
        self._time_s = min(max(time_s, 0.0), self.reel.duration_s)
        self._jumped, self._besides = True, ()
