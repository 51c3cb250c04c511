"""When each frame of a film is due on the clock of now, as far from the one before as it was recorded. No clock."""

from typing import Final, final

LONGEST_S: Final = 2.0
"""Where nobody looked for longer than that, the film goes on after `CUT_S`: no camera shall seem to have failed."""
CUT_S: Final = 0.5
"""From the last frame to the first again, too."""
_ASIDE_S: Final = 1.0
"""Frames of several cameras may be logged in another order than they were taken, by less than that."""
_LATE_S: Final = 0.25
"""A reader that is later than that goes on from there: the film is slower on such a machine, and never old."""


@final
class Pace:
    """Follows one film after the other."""

    def __init__(self) -> None:
        self._recorded_s: float | None = None
        self._due_s = -float("inf")
        self._shift_s = 0.0
        self._shifts = (0.0, -float("inf"), 0.0)

    def begin(self) -> None:
        """The next frame is the first of a film, whatever its time."""
        self._recorded_s = None

    def due_s(self, recorded_s: float, now_s: float) -> float:
        """When the frame that was taken at `recorded_s` [s] shall be shown, `now_s` or later unless it is late."""
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
        """The moment of the recording that belongs to `now_s` [s]: of a cut the one side, and then the other.

        May be called from any thread.
        """
        before_s, from_s, after_s = self._shifts
        return now_s - (before_s if now_s < from_s else after_s)

    def _move(self, shift_s: float, now_s: float) -> None:
        """From the middle of what is cut out on, so that what is known of either side is known around its frames."""
        self._shifts = (self._shift_s, max(now_s, self._due_s + CUT_S / 2), shift_s)
        self._shift_s = shift_s
