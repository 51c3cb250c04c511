"""Operator controller, the meeting point of threads: messages from the program, presses, and the painter.

Everything here is short and under one lock; nothing waits. STOP reaches the arm in the thread of the press, before
anything else is done.
"""

import math
import threading
import time
from collections.abc import Callable, Iterable
from functools import reduce
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float64

from app.core.colours import ColourRange
from app.core.dialogue.control import Lease
from app.core.dialogue.requests import Asked, ColourRequest, EditRequest, HandRequest, ModelRequest, Request
from app.core.messages import Decision, Message, Model, Notice, Proposal, ResumeRequest, StopRequest, fresh_id
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.rate_limiter import RateLimiter

Place: TypeAlias = Float64[np.ndarray, "3"]
_REFUSALS_EVERY_S = 10.0
"""Interval between notices of refused requests, so that a flood of them is one line."""
_COMMANDS_HZ, _COMMANDS_AT_ONCE = 2.0, 10.0
_WORDS_HZ, _WORDS_AT_ONCE = 0.5, 5.0
"""Rate limit of refusal notices, so that repeated presses do not repeat them."""
_IDLE_S = 60.0
"""Idle time after which another operator may take control."""


@final
class OperatorController:
    """The state behind a lock, and the effects of the operator's presses. Every method may be called from any thread.

    `stop` stops the arm; it must not block. `post` hands a request to the program, in order, without blocking. On the
    controller of a `replay` nobody commands, and there is nothing to stop.
    """

    def __init__(
        self,
        *,
        stop: Callable[[], None],
        post: Callable[[Request], object],
        now: Callable[[], float] = time.monotonic,
        replay: bool = False,
    ) -> None:
        self._stop = stop
        self._post = post
        self.now = now
        self._lock = threading.Lock()
        self._state = ConsoleState(replay=replay)
        self.changed = threading.Event()
        self._turned_away: dict[str, int] = {}
        self._told_s = self._used_s = -math.inf
        self._paces: dict[str, RateLimiter] = {}
        self._gone: set[str] = set()
        self._words = RateLimiter(now(), steady_hz=_WORDS_HZ, burst=_WORDS_AT_ONCE)

    @property
    def state(self) -> ConsoleState:
        """The present state of the console."""
        return self._state

    def show(self, message: Message) -> None:
        """Fold a message into the state."""
        with self._lock:
            self._state = self._state.after(message)
        self.changed.set()

    def reset(self, messages: Iterable[Message]) -> None:
        """Replace the state by a fold over these messages."""
        with self._lock:
            self._state = reduce(ConsoleState.after, messages, ConsoleState(replay=self._state.replay))
        self.changed.set()

    def stop(self, operator: str) -> None:
        """Stop the arm, now and in this thread; then record it.

        A held key presses STOP many times: each one reaches the arm, the first one the recording.
        """
        if self._state.replay:
            return
        self._stop()
        with self._lock:
            repeated = self._state.stop_s > self._state.resume_s
            if not repeated:
                self._issue(StopRequest(id=fresh_id("stop"), time_s=self.now(), operator=operator))

    def take_over(self, operator: str) -> None:
        """Stop the arm, now and in this thread, and ask for it by hand; ignored of operators who may not command.

        Under a stop the arm is at rest, and the request is refused in words: that stop is lifted by Resume alone.
        """
        with self._lock:
            if not self._may(operator):
                return
            stopped = self._state.is_stopped
        if not stopped:
            self._stop()
        with self._lock:
            self._issue(HandRequest(id=fresh_id("hand"), time_s=self.now(), operator=operator, act="take"))

    def ask(self, request: Asked) -> bool:
        """Send a request to the program; False where the operator has no permission."""
        with self._lock:
            may = self._may(request.operator)
            if may:
                self._issue(request)
            return may

    def resume(self, operator: str) -> None:
        """Request to go on; ignored where nothing is stopped."""
        with self._lock:
            if self._state.is_stopped and self._may(operator):
                self._issue(ResumeRequest(id=fresh_id("resume"), time_s=self.now(), operator=operator))

    def decide(self, proposal: Proposal, *, approve: bool, operator: str, reason: str = "") -> None:
        """Decide on the proposal that the pressed button belongs to; only the first decision counts."""
        decision = Decision(
            id=fresh_id("decision"),
            cause=(proposal.id,),
            time_s=self.now(),
            proposal_id=proposal.id,
            digest=proposal.motion.digest(),
            approve=approve,
            operator=operator,
            reason=reason,
        )
        with self._lock:
            pending = self._state.pending
            if self._state.decidable and pending is not None and pending.id == proposal.id and self._may(operator):
                self._issue(decision)

    def edit(self, proposal: Proposal, branch: int, start: Place, end: Place, operator: str) -> None:
        """Request the motion of a branch with its ends moved [m]; ignored unless that proposal is up for decision.

        One edit at a time: while one is being simulated, another is ignored.
        """
        request = EditRequest(
            id=fresh_id("edit"),
            cause=(proposal.id,),
            time_s=self.now(),
            operator=operator,
            proposal_id=proposal.id,
            start=start,
            end=end,
            branch=branch,
        )
        with self._lock:
            pending = self._state.pending
            up = self._state.decidable and pending is not None and pending.id == proposal.id
            if up and self._state.edit is None and self._may(operator):
                self._issue(request)

    def use_model(self, model: Model, source: str, *, operator: str) -> None:
        """Request to plan with this model from now on; `source` is its origin, in words."""
        with self._lock:
            if self._may(operator):
                self._issue(
                    ModelRequest(
                        id=fresh_id("model-request"),
                        cause=(model.id,),
                        time_s=self.now(),
                        operator=operator,
                        model=model,
                        source=source,
                    )
                )

    def use_colours(self, colour: ColourRange, *, operator: str) -> None:
        """Request to segment the object by these colours from now on."""
        with self._lock:
            if self._may(operator):
                self._issue(
                    ColourRequest(
                        id=fresh_id("colours"),
                        time_s=self.now(),
                        operator=operator,
                        hue_deg=colour.hue_deg,
                        saturation=colour.saturation,
                        value=colour.value,
                    )
                )

    def take(self, operator: str) -> None:
        """Take control, where no other operator uses it."""
        with self._lock:
            holder = self._state.holder
            if holder == operator or not self._in_pace(operator):
                return
            idle_s = self.now() - self._used_s
            if holder and idle_s < _IDLE_S:
                used = f"{holder} has it, and used it {idle_s:.0f} s ago"
                self._tell(f"{operator} cannot take control: {used}.")
            else:
                self._lend(operator, f"from {holder}, who did not use it" if holder else "nobody had it")

    def release(self, operator: str) -> None:
        """Release control."""
        with self._lock:
            if self._state.holder == operator and self._in_pace(operator):
                self._lend("", f"{operator} gave it back")

    def on_disconnect(self, operator: str) -> None:
        """Forget a browser that has left, and its control; its later presses have no effect."""
        with self._lock:
            self._gone.add(operator)
            self._paces.pop(operator, None)
            if self._state.holder == operator and not self._state.replay:
                self._lend("", f"{operator} has left")

    def tell(self, text: str) -> None:
        """Publish a notice about control."""
        with self._lock:
            self._tell(text)

    def blocked_reason(self, operator: str) -> str | None:
        """Reason why `operator` may not jog now, in words; None where allowed, which counts as use of control."""
        with self._lock:
            why = _blocked_reason(self._state, operator) if operator not in self._gone else f"{operator} has left"
            if why is None:
                self._used_s = self.now()
            return why

    def _may(self, operator: str) -> bool:
        """True where `operator` may command now. Where nobody has control, the first to command takes it."""
        if not self._in_pace(operator):
            return False
        if not self._state.open_to(operator):
            self._tell(f"{operator} has no control; {self._state.holder} has. Take it first.")
            return False
        if not self._state.holder:
            self._lend(operator, "nobody had it")
        self._used_s = self.now()
        return True

    def _in_pace(self, operator: str) -> bool:
        """True where `operator` is connected, not in a replay, and within the rate limit."""
        if operator in self._gone or self._state.replay:
            return False
        now_s = self.now()
        pace = self._paces.setdefault(operator, RateLimiter(now_s, steady_hz=_COMMANDS_HZ, burst=_COMMANDS_AT_ONCE))
        allowed = pace.allows(now_s)
        if not allowed:
            self._tell(f"{operator} sends commands too fast; some are ignored.")
        return allowed

    def _tell(self, text: str) -> None:
        """Publish a notice about control, unless too many were published just now."""
        if self._words.allows(self.now()):
            self._notice("control", text)

    def _lend(self, holder: str, why: str) -> None:
        self._used_s = self.now()
        self._issue(Lease(id=fresh_id("lease"), time_s=self.now(), holder=holder, why=why))

    def _notice(self, where: str, text: str) -> None:
        """Publish a notice that the program records."""
        self._post(Notice(id=fresh_id("notice"), time_s=self.now(), where=where, text=text))

    def turned_away(self, why: str) -> None:
        """Count a refused connection; report the counts now and then."""
        with self._lock:
            self._turned_away[why] = self._turned_away.get(why, 0) + 1
            if self.now() - self._told_s < _REFUSALS_EVERY_S:
                return
            told = "; ".join(f"{text.rstrip('.')}, {_times(count)}" for text, count in self._turned_away.items())
            self._turned_away, self._told_s = {}, self.now()
            self._notice("door", f"Somebody was refused. {told}.")

    def _issue(self, request: Request) -> None:
        self._state = self._state.after(request)
        self._post(request)
        self.changed.set()


def _blocked_reason(state: ConsoleState, operator: str) -> str | None:
    """Reason against jogging on this state. Control is not taken implicitly: a stuck stick must command nothing."""
    if state.fatal is not None:
        return "the program has ended"
    if state.is_stopped:
        return "a stop is in force: press Resume"
    if not state.cleared_by_hand:
        return "complete the checklist first"
    if not state.holder:
        return "nobody has control: press Take first"
    if state.holder != operator:
        return f"{state.holder} has control"
    return None if state.is_teleoperated else "choose the mode By hand first"


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"
