"""Calls over one transport: each waits for its own answer, and for no other."""

import contextlib
import math
import threading
import time
from collections import deque
from concurrent.futures import Future
from typing import Any, TypeVar, final

from app.rig.kinova.api.calls import CLOSE_SESSION, CREATE_SESSION, Call, Service
from app.rig.kinova.api.error_messages import refusal
from app.rig.kinova.api.errors import LinkLost, NoAnswer, Refused, WireError
from app.rig.kinova.api.protobuf import decode, encode
from app.rig.kinova.api.session import Empty, ErrorReply, SessionInfo
from app.rig.kinova.client.transport import Transport
from app.rig.kinova.client.wire import FrameKind, KortexFrame

Asked = TypeVar("Asked")
Answered = TypeVar("Answered")

_KEPT, _CLOSE_S, _JOIN_S, _TRIES = 1000, 0.3, 2.0, 3
"""Capacity of unpolled notifications, and timeouts of closing and joining [s] and attempts to log in."""


@final
class Router:
    """A session of the arm. Its thread receives; the caller sends, and waits."""

    def __init__(self, transport: Transport, name: str) -> None:
        self._transport, self._name = transport, name
        self._lock = threading.Lock()
        self._waiting: dict[int, Future[KortexFrame]] = {}
        self._calls = self._session = 0
        self._unheard_since_s = math.inf
        self.lost = ""
        self.notifications = deque[KortexFrame](maxlen=_KEPT)
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
        """Make a call without waiting for its answer. Raises LinkLost, also where none has come for the call's timeout.

        A lost one delays no other, so a stream of them goes on while it is sent again.
        """
        now_s = time.monotonic()
        if now_s - self._unheard_since_s > call.timeout_s:
            raise self._lose(f"The arm has not answered {call.name} for {call.timeout_s:.1f} s.")
        with self._lock:
            number = self._number()
            self._unheard_since_s = min(self._unheard_since_s, now_s)
        self._send(call, asked, number)

    def close(self) -> None:
        """Close the session where possible, and end."""
        if not self.lost and self._session:
            # If that fails, the arm closes a silent session by itself.
            with contextlib.suppress(LinkLost, Refused):
                self.call(CLOSE_SESSION, Empty(), _CLOSE_S)
        self._lose("The connection was closed.")
        if threading.current_thread() is not self._thread:
            self._thread.join(_JOIN_S)

    def cut(self) -> None:
        """End silently."""
        self._lose("The connection was cut from here.")

    def _exchange(self, call: Call[Asked, Answered], asked: Asked, timeout_s: float) -> KortexFrame:
        future, number = self._expect()
        try:
            self._send(call, asked, number)
            answer = future.result(timeout_s)
        except TimeoutError:
            raise self._timeout_error(call.name, timeout_s) from None
        finally:
            with self._lock:
                self._waiting.pop(number, None)
        if answer.error:
            raise Refused(call.name, answer.error, answer.sub_error, _error_text(answer))
        return answer

    def _send(self, call: Call[Asked, Any], asked: Asked, number: int) -> None:
        """Send a request. Raises LinkLost."""
        request = KortexFrame(
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

    def _expect(self) -> tuple[Future[KortexFrame], int]:
        """A future for the answer to a call, and the call's number. Raises LinkLost where none can come."""
        future: Future[KortexFrame] = Future()
        with self._lock:
            number = self._number()
            self._waiting[number] = future
        return future, number

    def _number(self) -> int:
        """Number of the next call; the lock must be held."""
        if self.lost:
            raise LinkLost(self.lost)
        self._calls = self._calls % 0xFFFF + 1
        return self._calls

    def _timeout_error(self, call: str, timeout_s: float) -> NoAnswer:
        """Error of an unanswered call: on a stream the connection is lost; a datagram may have been."""
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
                    self._deliver(frame)
                elif frame.kind == FrameKind.NOTIFICATION:
                    self.notifications.append(frame)
        except (LinkLost, WireError) as error:
            reason = str(error)
        self._lose(reason)

    def _deliver(self, frame: KortexFrame) -> None:
        """Deliver an answer to its waiting call; late answers, and those to `tell`, are dropped.

        Raises LinkLost where the arm does not know this session any more: `tell` would not notice.
        """
        with self._lock:
            future = self._waiting.pop(frame.message, None)
        if future is not None:
            future.set_result(frame)
        elif frame.error and frame.service == Service.SESSION:
            raise LinkLost(f"The arm has closed the session: {refusal(frame.sub_error, _error_text(frame))}")

    def _lose(self, reason: str) -> LinkLost:
        """Record the first reason for the loss, and wake all waiting calls."""
        with self._lock:
            self.lost = self.lost or reason
            waiting, self._waiting = self._waiting, {}
        self._transport.close()
        for future in waiting.values():
            future.set_exception(LinkLost(self.lost))
        return LinkLost(self.lost)


def _error_text(answer: KortexFrame) -> str:
    """Text of an error reply, empty where it cannot be read."""
    try:
        return decode(ErrorReply, answer.payload).error_sub_string
    except WireError:
        return ""
