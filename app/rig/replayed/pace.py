"""Replay schedule: due times of a film's frames on the present clock, at their recorded intervals. No clock."""

from typing import Final, final

LONGEST_S: Final = 2.0
"""Longest gap [s] that is replayed; a longer one becomes `CUT_S`, so that no camera seems to have failed."""
CUT_S: Final = 0.5
"""Gap [s] at a cut, and between the last frame and the first of the next round."""
_ASIDE_S: Final = 1.0
"""Largest difference [s] between the order of logging and of exposure among several cameras."""
_LATE_S: Final = 0.25
"""Delay of the reader [s] beyond which the schedule shifts: the film then runs slower, but never stale."""


@final
class PlaybackSchedule:
    """Schedule of one film after the other."""

    def __init__(self) -> None:
        self._recorded_s: float | None = None
        self._due_s = -float("inf")
        self._shift_s = 0.0
        self._shifts = (0.0, -float("inf"), 0.0)

    def begin(self) -> None:
        """Begin a film: the next frame is its first, whatever its time."""
        self._recorded_s = None

    def due_s(self, recorded_s: float, now_s: float) -> float:
        """Due time [s] of the frame exposed at `recorded_s` [s]: `now_s` or later, unless it is late."""
        if self._recorded_s is None or not -_ASIDE_S < recorded_s - self._recorded_s < LONGEST_S:
            self._move(max(now_s, self._due_s + CUT_S) - recorded_s, now_s)
        late_s = now_s - (recorded_s + self._shift_s)
        if late_s > _LATE_S:
            self._move(self._shift_s + late_s, now_s)
        self._recorded_s = recorded_s
        due_s = recorded_s + self._shift_s
        self._due_s = max(self._due_s, due_s)
        return due_s

    def recorded_s(self, now_s: float) -> float:
        """Recorded time [s] that belongs to `now_s` [s]; at a cut it jumps from one side to the other.

        May be called from any thread.
        """
        before_s, from_s, after_s = self._shifts
        return now_s - (before_s if now_s < from_s else after_s)

    def _move(self, shift_s: float, now_s: float) -> None:
        """Shift the schedule from the middle of a cut, so that either side is valid around its own frames."""
        self._shifts = (self._shift_s, max(now_s, self._due_s + CUT_S / 2), shift_s)
        self._shift_s = shift_s
