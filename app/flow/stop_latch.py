"""Stop latch: nothing moves from a stop until an operator resumes."""

from collections.abc import Callable
from typing import final

import anyio

from app.core.announcer import MessageBus
from app.core.errors import DeviceError
from app.core.messages import Executed, ResumeRequest, StopRequest, fresh_id
from app.core.ports import Clock, Rig
from app.flow.modes import Modes

_UNATTENDED_S = 120.0
"""Timeout of a run with automatic approval for a resume after a stop."""
_PAUSE_S, _MOST_PAUSES = 5.0, 3
"""Pause before it goes on by itself if only the arm's own process stopped it, and the most pauses in a row."""


@final
class StopLatch:
    """Stop latch. `free`: motion is permitted; `resumed_s`: time of the last resume, or of the program's begin [s].

    `tried`: STOP was pressed in this session, and the arm went on after it was lifted.

    A run without an operator is `unattended`: waiting ends with an error then, and after a stop that
    nobody pressed, most often of a computer that is too busy, it goes on by itself. Nothing real moves in such a run.
    """

    def __init__(self, rig: Rig, modes: Modes, announcer: MessageBus, clock: Clock, *, unattended: bool) -> None:
        self._rig, self._modes = rig, modes
        self._announcer, self._clock = announcer, clock
        self._patience_s = _UNATTENDED_S if unattended else None
        self._free = anyio.Event()
        self._free.set()
        self.resumed_s = clock.now()
        self._pressed = self.tried = False
        self._passes, self._pauses = False, 0

    @property
    def free(self) -> bool:
        """True if motion is permitted."""
        return self._free.is_set()

    def pressed(self, request: StopRequest) -> None:
        """React to an operator's STOP; the arm has stopped already."""
        self._pressed = True
        self.hold(f"Stopped by {request.operator}.")

    def hold(self, why: str, *, passes: bool = False) -> None:
        """Forbid motion until the operator resumes, and void the plan that is shown.

        `passes`: an unattended run may go on by itself.
        """
        if self.free:
            self._free = anyio.Event()
        self._passes = passes and self._patience_s is not None and self._pauses < _MOST_PAUSES
        self._modes.interrupt("was made before the stop; planning again")
        self._modes.stopped()
        self._announcer.notice("stop", f"{why.rstrip('.')}. {self._onward}")

    @property
    def _onward(self) -> str:
        """Text about the way to go on."""
        if self._passes:
            return f"Nothing real moves, so the run goes on by itself in {_PAUSE_S:.0f} s unless somebody presses STOP."
        until = f" within {self._patience_s:.0f} s" if self._patience_s else ""
        return f"Press Resume in the console{until} to go on."

    def heed(self, executed: Executed) -> None:
        """Hold where the arm itself ended a motion before its time."""
        if executed.outcome == "completed":
            self._pauses = 0
        elif executed.time_s > self.resumed_s:
            own = executed.outcome == "stopped" and not self._rig.arm.held
            self.hold(executed.reason, passes=self.free and own)

    async def resume(self, request: ResumeRequest) -> None:
        """Go on, if the arm does."""
        try:
            await self._rig.arm.reset(asked_s=request.time_s)
        except DeviceError as error:
            self._announcer.notice("stop", str(error))
        else:
            self.resumed_s = self._clock.now()
            self.tried = self._pressed
            self._free.set()
            self._announcer.notice("stop", f"Resumed by {request.operator}.")

    async def resumed(self, do: Callable[[str], None]) -> None:
        """Wait until the operator resumes, if something stopped; for ever, unless the run is unattended."""
        while not self.free:
            do("stopped")
            passes = self._passes
            with self._clock.move_on_after(_PAUSE_S if passes else self._patience_s) as patience:
                await self._free.wait()
            if patience.cancelled_caught and self._passes:
                await self._go_on()
            elif patience.cancelled_caught and not passes:
                raise DeviceError(f"The arm was stopped and nobody pressed Resume for {self._patience_s:.0f} s.")

    async def _go_on(self) -> None:
        """Resume as an operator would; once, and not where somebody has pressed STOP since, heard of here or not."""
        self._passes, self._pauses = False, self._pauses + 1
        request = ResumeRequest(id=fresh_id("resume"), time_s=self._clock.now(), operator="the run")
        if not self._rig.arm.held:  # What is pressed from now on is newer than the request, which does not lift it.
            await self.resume(self._announcer.say(request))
