"""Grip force limit by the current of the fingers' motor.

The arm takes no force limit for a Robotiq 2F-85: `GRIPPER_FORCE` is not implemented (`Base.proto`; ros_kortex #117),
and the gripper's own limit cannot be reached through it (`force` of `GripperCyclicMessage.proto` is unused). It
measures the current of the gripper's motor, which the gripper itself limits to limit its force (its manual, register
FORCE). So the fingers are monitored here, and held where they are once the current has been too high for a while.
"""

import contextlib
import threading
from typing import Final, final

from app.rig.kinova.api.errors import LinkLost, Refused
from app.rig.kinova.feedback_conversion import ArmFeedback
from app.rig.kinova.kortex import Kortex

_LONG_S: Final = 0.05
"""Time [s] that the current must exceed the limit: the motor draws more for a moment as it starts."""
_AGAIN_S: Final = 0.20
"""Time [s] until the effect of a command is measured: two cycles of the arm, and the fingers' own motion."""
_STEP: Final = 0.004
"""Stroke by which fingers that press too hard at rest give way: one count of 255."""
_OPENED: Final = 0.02
"""Opening of the command beyond which the fingers hold nothing any more, and may be closed anew."""


@final
class Grip:
    """Fingers whose motor current is limited to `most_ma` [mA]; None for no limit.

    `look` is called by one feedback thread at a time, `watch` is the body of a thread of its own, and `close` may be
    called from any other.
    """

    def __init__(self, kortex: Kortex, most_ma: float | None) -> None:
        self._kortex, self._most_ma = kortex, most_ma
        self._lock, self._pressed = threading.Lock(), threading.Event()
        self._since_s: float | None = None
        self._not_before_s = 0.0
        self._firm: float | None = None

    def close(self, closed: float) -> None:
        """Move the fingers, 0 open to 1 closed, at most to where they pressed too hard. Raises Refused."""
        with self._lock:
            if self._firm is not None and closed < self._firm - _OPENED:
                self._firm = None
            told = closed if self._firm is None else min(closed, self._firm)
        self._kortex.grip(told)

    def look(self, seen: ArmFeedback) -> None:
        """Update the state of the grip from a measurement. Never blocks."""
        if self._most_ma is None or seen.time_s < self._not_before_s:
            return
        if seen.gripper_ma <= self._most_ma:
            self._since_s = None
            return
        self._since_s = seen.time_s if self._since_s is None else self._since_s
        if seen.time_s - self._since_s < _LONG_S:
            return
        self._since_s, self._not_before_s = None, seen.time_s + _AGAIN_S
        with self._lock:
            # Fingers that were stopped before and still press are opened a little.
            standing = self._firm is not None and seen.closed <= self._firm + _STEP
            self._firm = max(seen.closed - (_STEP if standing else 0.0), 0.0)
        self._pressed.set()

    def watch(self, over: threading.Event) -> None:
        """Relax the fingers whenever they press too hard, until it is `over` and `end` was called."""
        while not over.is_set():
            self._pressed.wait()
            self._pressed.clear()
            with self._lock:
                firm = self._firm
            if over.is_set() or firm is None:
                continue
            # A lost connection is reported elsewhere, and an arm that refuses moves no fingers.
            with contextlib.suppress(LinkLost, Refused):
                self._kortex.grip(firm)

    def end(self) -> None:
        """Wake the watching thread."""
        self._pressed.set()
