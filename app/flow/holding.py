"""Whether anything may move: a stop holds until somebody resumes."""

from collections.abc import Callable
from typing import final

import anyio

from app.core.announcer import Announcer
from app.core.errors import DeviceError
from app.core.messages import Executed, ResumeRequest, StopRequest
from app.core.ports import Clock, Rig
from app.flow.modes import Modes

_UNATTENDED_S = 120.0
"""How long a run with automatic approval waits for somebody to resume it after a stop."""


@final
class Holding:
    """`free`: nothing is held; `resumed_s`: when somebody resumed last, or the program began [s].

    `tried`: somebody pressed STOP in this session, and the arm went on after it was lifted.

    Where nobody is expected to be there, it is `unattended`: waiting ends with an error then.
    """

    def __init__(self, rig: Rig, modes: Modes, announcer: Announcer, clock: Clock, *, unattended: bool) -> None:
        self._rig, self._modes = rig, modes
        self._announcer, self._clock = announcer, clock
        self._patience_s = _UNATTENDED_S if unattended else None
        self._free = anyio.Event()
        self._free.set()
        self.resumed_s = clock.now()
        self._pressed = self.tried = False

    @property
    def free(self) -> bool:
        """Whether something may move."""
        return self._free.is_set()

    def pressed(self, request: StopRequest) -> None:
        """Somebody pressed STOP; the arm has stopped already."""
        self._pressed = True
        self.hold(f"Stopped by {request.operator}.")

    def hold(self, why: str) -> None:
        """Nothing moves from now on until the operator resumes, and the plan that is shown never."""
        if self.free:
            self._free = anyio.Event()
        self._modes.interrupt("was made before the stop; planning again")
        self._modes.stopped()
        until = f" within {self._patience_s:.0f} s" if self._patience_s else ""
        self._announcer.notice("stop", f"{why.rstrip('.')}. Press Resume in the console{until} to go on.")

    def heed(self, executed: Executed) -> None:
        """Hold where the arm itself ended a motion before its time."""
        if executed.outcome != "completed" and executed.time_s > self.resumed_s:
            self.hold(executed.reason)

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
        """Wait until the operator resumes, if something stopped; for ever, unless nobody is expected to be there."""
        while not self.free:
            do("stopped")
            with anyio.move_on_after(self._patience_s) as patience:
                await self._free.wait()
            if patience.cancelled_caught:
                raise DeviceError(f"The arm was stopped and nobody pressed Resume for {self._patience_s:.0f} s.")
