"""Modes of autonomy, and the operator who asked for the present one."""

from typing import Literal, TypeAlias, final

import anyio

from app.core.announcer import MessageBus
from app.core.dialogue.control import Lease, Mode, ModeName, ModeRequest
from app.core.messages import MessageId, fresh_id
from app.core.ports import Clock

Automatic: TypeAlias = Literal["freely", "confirmed", "never"]
"""Policy for unattended motion: allowed on request, after confirmation, or never."""
_MOST = 1000
"""Largest number of motions without approval."""


@final
class Modes:
    """The present mode, and the cancellation of plans that a change of it, or another event, makes void.

    `interruptions` counts the times that plans became void; `interrupted` says why, the last time.
    A mode requested at a console lasts no longer than it is safe: automatic ends with a stop, and when
    the operator who asked for it loses control. The one that the program was `started` in ends with a request alone.
    """

    def __init__(
        self, started: ModeName, motions: int, announcer: MessageBus, clock: Clock, *, automatic: Automatic
    ) -> None:
        self._automatic = automatic
        self._announcer, self._clock = announcer, clock
        self._holder = ""
        self._waiting, self._lasting = anyio.CancelScope(), anyio.CancelScope()
        self._changed = anyio.Event()
        self.ended = False
        self.interruptions, self.interrupted = 0, ""
        self.now = Mode(id=fresh_id("mode"), time_s=clock.now(), mode=started, motions=motions, why="")

    @property
    def name(self) -> ModeName:
        """Name of the present mode."""
        return self.now.mode

    def begin(self) -> None:
        """Say the first one."""
        self._announcer.say(self.now)

    def asked(self, request: ModeRequest) -> None:
        """Change the mode on request, or say why not."""
        if request.mode == "automatic" and (why := self._refusal(request)):
            self._announcer.notice("mode", why, request.id)
            return
        self._holder = request.operator
        why = f"asked for by {request.operator}"
        if request.mode == self.name != "automatic":
            self._say(request.mode, why, request.id, motions=0)  # What is under way is what is wanted.
            return
        motions = request.motions if request.mode == "automatic" else 0
        self.set(request.mode, why, request.id, motions=motions)

    def _refusal(self, request: ModeRequest) -> str:
        """Why so many motions are not made automatically; nothing where they are."""
        if self._automatic == "never":
            return "This arm is real: approve each motion, or start `dipac console` with --allow-automatic."
        if self._automatic == "confirmed" and not request.confirmed:
            return "This arm is real: confirm that its motions shall be made without approval."
        possible = 0 < request.motions <= _MOST
        return "" if possible else f"{request.motions} motions were asked for; automatic is for 1 to {_MOST}."

    def set(self, mode: ModeName, why: str, *cause: MessageId, motions: int = 0) -> None:
        """Change to `mode`; what waits under the old one is given up."""
        self._say(mode, why, *cause, motions=motions)
        self._leave()

    def end(self) -> None:
        """End the session: cancel everything."""
        self.ended = True
        self._leave()

    def on_control_transfer(self, lease: Lease) -> None:
        """Control has changed hands."""
        if self.name in ("automatic", "teleoperate") and self._holder not in ("", lease.holder):
            back = "idle" if self.name == "teleoperate" else "approve each"
            self.set(back, f"{self._holder} has no control any more", lease.id)

    def stopped(self) -> None:
        """The arm was stopped."""
        if self.name == "automatic" and self._holder:
            self.set("approve each", "the arm was stopped")

    def moved(self) -> None:
        """Count a motion without approval; the last one of a request ends the mode."""
        if self.name != "automatic":
            return
        left = max(self.now.motions - 1, 0)
        if left or not self._holder:
            self._say("automatic", self.now.why, motions=left)
        else:
            self.set("approve each", "the motions that were asked for are made")

    @property
    def over(self) -> anyio.Event:
        """Set once the mode is another."""
        return self._changed

    def lasting(self) -> anyio.CancelScope:
        """Cancel scope that ends with the mode."""
        self._lasting = anyio.CancelScope()
        return self._lasting

    def waiting(self, deadline_s: float) -> anyio.CancelScope:
        """Cancel scope of a wait for a decision, which ends at the next interruption or after `deadline_s`."""
        self._waiting = self._clock.move_on_after(deadline_s)
        return self._waiting

    def interrupt(self, why: str) -> None:
        """Void the plan that is up or being made. `why` completes "the plan ..."."""
        self.interruptions, self.interrupted = self.interruptions + 1, why
        self._waiting.cancel()

    def _leave(self) -> None:
        self.interrupt("was made in another mode")
        self._lasting.cancel()
        self._changed.set()
        self._changed = anyio.Event()

    def _say(self, mode: ModeName, why: str, *cause: MessageId, motions: int) -> None:
        now_s = self._clock.now()
        self.now = Mode(id=fresh_id("mode"), cause=cause, time_s=now_s, mode=mode, motions=motions, why=why)
        self._announcer.say(self.now)
