"""Emulated gripper: two fingers that close to their target, or until they meet something."""

from typing import final

from app.rig.kinova.api.codes import GripperMode
from app.rig.kinova.api.messages import GripperCommand, GripperMessage

FULL_S = 0.6
"""Time from open to closed at full speed: a Robotiq 2F-85 closes 85 mm at up to 150 mm/s (its manual)."""
_THERE = 1e-6
_RESTS_MA, _MOVES_MA, _PRESSES_MA, _PRESSED = 20.0, 120.0, 800.0, 0.1
"""Motor currents [mA] at rest, in motion and at the limit, and the share of the stroke pressed into an object at
which the limit is reached. Assumed: the relation of this motor's current to force is not published."""


@final
class Fingers:
    """Fingers: `position` 0 open to 1 closed; `moving` as long as it changes."""

    def __init__(self) -> None:
        self.position, self._target, self._speed = 0.0, 0.0, 1.0
        self.moving, self.holds = False, False

    def command(self, command: GripperCommand) -> None:
        """Go to a position, or move at a speed; above 0 opens."""
        value = (command.gripper or GripperMessage()).finger[0].value
        if command.mode == GripperMode.POSITION:
            self._target, self._speed = min(max(value, 0.0), 1.0), 1.0
        else:
            self._target, self._speed = (0.0 if value > 0 else 1.0), min(abs(value), 1.0)
        self.moving, self.holds = self._speed > 0, False

    def stop(self) -> None:
        """Stop where they are."""
        self.moving = False

    @property
    def current_ma(self) -> float:
        """Motor current [mA]: higher in motion, and rising with the distance commanded into a held object."""
        if self.holds:
            return _RESTS_MA + _PRESSES_MA * min((self._target - self.position) / _PRESSED, 1.0)
        return _MOVES_MA if self.moving else _RESTS_MA

    def advance(self, duration_s: float, object_at: float) -> None:
        """Move towards the target, as far as an object between the fingers allows."""
        if not self.moving:
            return
        reach = self._speed * duration_s / FULL_S
        wanted = self.position + min(max(self._target - self.position, -reach), reach)
        # An object stops closing fingers, but does not move ones that are closed further.
        met = max(min(wanted, object_at), min(self.position, wanted))
        self.holds = met < wanted - _THERE
        self.position = met
        self.moving = not self.holds and abs(self._target - self.position) > _THERE
