"""Fingers that press no harder than they may, as far as the current of their motor tells.

The arm takes no limit of force for a Robotiq 2F-85: `GRIPPER_FORCE` is not implemented (`Base.proto`; ros_kortex #117),
and the gripper's own limit cannot be reached through it (`force` of `GripperCyclicMessage.proto` is unused). It
measures the current of the gripper's motor, which is what the gripper itself limits to limit its force (its manual,
register FORCE). So the fingers are watched here, and told to stay where they are when it has been too high for a while.
"""

import contextlib
import threading
from typing import Final, final

from app.rig.kinova.errors import LinkLost, Refused
from app.rig.kinova.kortex import Kortex
from app.rig.kinova.seen import Seen

_LONG_S: Final = 0.05
"""As they set out, the motor draws more for a moment."""
_AGAIN_S: Final = 0.20
"""What a command changes is seen after so long: two cycles of the arm, and the fingers' own way."""
_STEP: Final = 0.004
"""Fingers that press too hard where they stand give way by so much of their stroke: one count of 255."""
_OPENED: Final = 0.02
"""Fingers that are told to open by more than this hold nothing any more, and may be closed anew."""


@final
class Grip:
    """The fingers, of whose motor `most_ma` [mA] are allowed; None where any current is.

    `look` is called by one thread at a time of those that hear what the arm measures, `watch` is the body of one of its
    own, and `close` is for any other.
    """

    def __init__(self, kortex: Kortex, most_ma: float | None) -> None:
        self._kortex, self._most_ma = kortex, most_ma
        self._lock, self._pressed = threading.Lock(), threading.Event()
        self._since_s: float | None = None
        self._not_before_s = 0.0
        self._firm: float | None = None

    def close(self, closed: float) -> None:
        """Move the fingers, 0 open to 1 closed: no further than to where they pressed too hard. Raises Refused."""
        with self._lock:
            if self._firm is not None and closed < self._firm - _OPENED:
                self._firm = None
            told = closed if self._firm is None else min(closed, self._firm)
        self._kortex.grip(told)

    def look(self, seen: Seen) -> None:
        """See whether they press too hard. Waits for nothing."""
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
            # Where they were stopped before and press on, they are told to open a little.
            standing = self._firm is not None and seen.closed <= self._firm + _STEP
            self._firm = max(seen.closed - (_STEP if standing else 0.0), 0.0)
        self._pressed.set()

    def watch(self, over: threading.Event) -> None:
        """Tell the fingers, whenever they press too hard, until it is `over` and `end` was called."""
        while not over.is_set():
            self._pressed.wait()
            self._pressed.clear()
            with self._lock:
                firm = self._firm
            if over.is_set() or firm is None:
                continue
            # A connection that is lost says so itself, and an arm that refuses moves no fingers.
            with contextlib.suppress(LinkLost, Refused):
                self._kortex.grip(firm)

    def end(self) -> None:
        """Wake the thread that watches."""
        self._pressed.set()
