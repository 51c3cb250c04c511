"""Where threads meet: the program shows messages, the operator presses buttons, the painter looks.

Everything here is short and under one lock; nothing waits. STOP reaches the arm in the thread that the press came in,
before anything else is done.
"""

import threading
import time
from collections.abc import Callable
from typing import TypeAlias, final

from app.core.messages import Decision, Message, Proposal, ResumeRequest, StopRequest, fresh_id
from app.ui.board import Board

Request: TypeAlias = Decision | StopRequest | ResumeRequest


@final
class Desk:
    """The board behind a lock, and what the operator's presses do. Every method may be called from any thread.

    `stop` tells the arm; it must not block. `post` hands a request to the program, in order, without blocking.
    """

    def __init__(
        self,
        *,
        stop: Callable[[], None],
        post: Callable[[Request], object],
        now: Callable[[], float] = time.monotonic,
    ) -> None:
        self._stop = stop
        self._post = post
        self.now = now
        self._lock = threading.Lock()
        self._board = Board()
        self.changed = threading.Event()

    @property
    def board(self) -> Board:
        """What is known at this moment."""
        return self._board

    def show(self, message: Message) -> None:
        """Fold a message in."""
        with self._lock:
            self._board = self._board.after(message)
        self.changed.set()

    def stop(self, operator: str) -> None:
        """Stop the arm, now and in this thread; then put it on record.

        A held key presses STOP many times: each one reaches the arm, the first one the record.
        """
        self._stop()
        with self._lock:
            repeated = self._board.stop_s > self._board.resume_s
            if not repeated:
                self._issue(StopRequest(id=fresh_id("stop"), time_s=self.now(), operator=operator))

    def resume(self, operator: str) -> None:
        """Ask to go on; ignored where nothing is stopped."""
        with self._lock:
            if self._board.stopped:
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
            pending = self._board.pending
            if self._board.decidable and pending is not None and pending.id == proposal.id:
                self._issue(decision)

    def _issue(self, request: Request) -> None:
        self._board = self._board.after(request)
        self._post(request)
        self.changed.set()
