"""Calls over one transport: each waits for its own answer, and for no other."""

import contextlib
import math
import threading
import time
from collections import deque
from concurrent.futures import Future
from typing import Any, TypeVar, final

from app.rig.kinova.calls import CLOSE_SESSION, CREATE_SESSION, Call, Service
from app.rig.kinova.errors import LinkLost, NoAnswer, Refused, WireError
from app.rig.kinova.protobuf import decode, encode
from app.rig.kinova.session import Empty, ErrorReply, SessionInfo
from app.rig.kinova.transport import Transport
from app.rig.kinova.wire import Frame, FrameKind
from app.rig.kinova.words import refusal

Asked = TypeVar("Asked")
Answered = TypeVar("Answered")

_KEPT, _CLOSE_S, _JOIN_S, _TRIES = 1000, 0.3, 2.0, 3
"""Of notifications that nobody has polled, the last so many are kept."""


@final
class Router:
    """A session of the arm. Its thread receives; whoever calls sends, and waits."""

    def __init__(self, transport: Transport, name: str) -> None:
        self._transport, self._name = transport, name
        self._lock = threading.Lock()
        self._waiting: dict[int, Future[Frame]] = {}
        self._calls = self._session = 0
        self._unheard_since_s = math.inf
        self.lost = ""
        self.notifications = deque[Frame](maxlen=_KEPT)
        self._thread = threading.Thread(target=self._receive, name=f"dipac kinova {name}", daemon=True)
        self._thread.start()

    def create_session(self, info: SessionInfo) -> None:
        """Log in; again where a datagram was lost. Raises Refused and NoAnswer."""
        for attempt in range(1, _TRIES + 1):
            try:
                answer = self._exchange(CREATE_SESSION, info, CREATE_SESSION.timeout_s / attempt)
            except NoAnswer:
                if self._transport.reliable or attempt == _TRIES:
                    raise
            else:
                self._session = answer.session
                return

    def call(self, call: Call[Asked, Answered], asked: Asked, timeout_s: float | None = None) -> Answered:
        """Make a call and wait for its answer. Raises Refused, NoAnswer and LinkLost."""
        answer = self._exchange(call, asked, call.timeout_s if timeout_s is None else timeout_s)
        try:
            return decode(call.answered, answer.payload)
        except WireError as error:
            raise self._lose(f"The arm's answer to {call.name} cannot be read: {error}") from None

    def tell(self, call: Call[Asked, Any], asked: Asked) -> None:
        """Make a call whose answer nobody waits for. Raises LinkLost, also where for as long as its patience none came.

        One that is lost on the way holds up no other: so a stream of them goes on while it is sent again.
        """
        now_s = time.monotonic()
        if now_s - self._unheard_since_s > call.timeout_s:
            raise self._lose(f"The arm has not answered {call.name} for {call.timeout_s:.1f} s.")
        with self._lock:
            number = self._number()
            self._unheard_since_s = min(self._unheard_since_s, now_s)
        self._send(call, asked, number)

    def close(self) -> None:
        """Say goodbye where that is possible, and end."""
        if not self.lost and self._session:
            # Where that fails, the arm closes a silent session by itself.
            with contextlib.suppress(LinkLost, Refused):
                self.call(CLOSE_SESSION, Empty(), _CLOSE_S)
        self._lose("The connection was closed.")
        if threading.current_thread() is not self._thread:
            self._thread.join(_JOIN_S)

    def cut(self) -> None:
        """End without a word."""
        self._lose("The connection was cut from here.")

    def _exchange(self, call: Call[Asked, Answered], asked: Asked, timeout_s: float) -> Frame:
        future, number = self._expect()
        try:
            self._send(call, asked, number)
            answer = future.result(timeout_s)
        except TimeoutError:
            raise self._unanswered(call.name, timeout_s) from None
        finally:
            with self._lock:
                self._waiting.pop(number, None)
        if answer.error:
            raise Refused(call.name, answer.error, answer.sub_error, _said(answer))
        return answer

    def _send(self, call: Call[Asked, Any], asked: Asked, number: int) -> None:
        """Raises LinkLost."""
        request = Frame(
            kind=FrameKind.REQUEST,
            service=call.service,
            function=call.function,
            session=self._session,
            message=number,
            payload=encode(asked),
        )
        try:
            self._transport.send(request)
        except LinkLost as error:
            raise self._lose(str(error)) from None

    def _expect(self) -> tuple[Future[Frame], int]:
        """A place for the answer to a call of that number. Raises LinkLost where none can come."""
        future: Future[Frame] = Future()
        with self._lock:
            number = self._number()
            self._waiting[number] = future
        return future, number

    def _number(self) -> int:
        """Of the next call, while the lock is held."""
        if self.lost:
            raise LinkLost(self.lost)
        self._calls = self._calls % 0xFFFF + 1
        return self._calls

    def _unanswered(self, call: str, timeout_s: float) -> NoAnswer:
        """On a stream no answer means no arm; a datagram may have been lost."""
        error = NoAnswer(f"The arm did not answer {call} in {timeout_s:.2f} s.")
        if self._transport.reliable:
            self._lose(str(error))
        return error

    def _receive(self) -> None:
        reason = "The connection was closed."
        try:
            for frame in self._transport.frames():
                self._unheard_since_s = math.inf
                if frame.kind == FrameKind.RESPONSE:
                    self._answered(frame)
                elif frame.kind == FrameKind.NOTIFICATION:
                    self.notifications.append(frame)
        except (LinkLost, WireError) as error:
            reason = str(error)
        self._lose(reason)

    def _answered(self, frame: Frame) -> None:
        """Hand an answer to whoever waits for it; one that comes too late, or to what was told, is of no more interest.

        Raises LinkLost where the arm does not know this session any more: who tells would not hear of it.
        """
        with self._lock:
            future = self._waiting.pop(frame.message, None)
        if future is not None:
            future.set_result(frame)
        elif frame.error and frame.service == Service.SESSION:
            raise LinkLost(f"The arm has closed the session: {refusal(frame.sub_error, _said(frame))}")

    def _lose(self, reason: str) -> LinkLost:
        """Note why this is of no use any more, the first reason alone, and let nobody wait for longer."""
        with self._lock:
            self.lost = self.lost or reason
            waiting, self._waiting = self._waiting, {}
        self._transport.close()
        for future in waiting.values():
            future.set_exception(LinkLost(self.lost))
        return LinkLost(self.lost)


def _said(answer: Frame) -> str:
    """What an error says for itself, where it can be read."""
    try:
        return decode(ErrorReply, answer.payload).error_sub_string
    except WireError:
        return ""
