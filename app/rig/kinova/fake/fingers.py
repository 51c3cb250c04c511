"""The gripper: two fingers that close until they are where they shall be, or meet something."""

from typing import final

from app.rig.kinova.codes import GripperMode
from app.rig.kinova.messages import Gripper, GripperCommand

FULL_S = 0.6
"""From open to closed at full speed: a Robotiq 2F-85 closes 85 mm at up to 150 mm/s (its manual)."""
_THERE = 1e-6
_RESTS_MA, _MOVES_MA, _PRESSES_MA, _PRESSED = 20.0, 120.0, 800.0, 0.1
"""Of current, and at how much of the stroke in what it holds the motor draws all that it can. Assumed: nobody published
how the current of this motor goes with its force."""


@final
class Fingers:
    """`position` 0 open to 1 closed; `moving` as long as it changes."""

    def __init__(self) -> None:
        self.position, self._target, self._speed = 0.0, 0.0, 1.0
        self.moving, self.holds = False, False

    def command(self, command: GripperCommand) -> None:
        """Go to a position, or on at a speed, of which above 0 opens."""
        value = (command.gripper or Gripper()).finger[0].value
        if command.mode == GripperMode.POSITION:
            self._target, self._speed = min(max(value, 0.0), 1.0), 1.0
        else:
            self._target, self._speed = (0.0 if value > 0 else 1.0), min(abs(value), 1.0)
        self.moving, self.holds = self._speed > 0, False

    def stop(self) -> None:
        """Stay."""
        self.moving = False

    @property
    def current_ma(self) -> float:
        """Of the motor: more where it moves, and the more, the further the fingers shall be in what they hold."""
        if self.holds:
            return _RESTS_MA + _PRESSES_MA * min((self._target - self.position) / _PRESSED, 1.0)
        return _MOVES_MA if self.moving else _RESTS_MA

    def advance(self, duration_s: float, object_at: float) -> None:
        """Close as far as what is between the fingers allows."""
        if not self.moving:
            return
        reach = self._speed * duration_s / FULL_S
        wanted = self.position + min(max(self._target - self.position, -reach), reach)
        # What is between the fingers stops them; it pulls none of them that are closed further.
        met = max(min(wanted, object_at), min(self.position, wanted))
        self.holds = met < wanted - _THERE
        self.position = met
        self.moving = not self.holds and abs(self._target - self.position) > _THERE
