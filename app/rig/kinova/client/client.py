"""This program's own client: two sessions on sockets, a timeout on every call, and no keep-alive thread.

Kinova's client keeps a session alive from a thread of its own, so that an arm moves on while the program that commands
it hangs. Here only the caller does: where its loop hangs, the arm hears nothing and stops by itself.
"""

import contextlib
import threading
from typing import Any, TypeVar, final

from app.rig.kinova.api.calls import Call, Service, Topic
from app.rig.kinova.api.errors import LinkLost, NoAnswer
from app.rig.kinova.api.protobuf import decode
from app.rig.kinova.api.session import NotificationOptions, SessionInfo
from app.rig.kinova.client.link import Address
from app.rig.kinova.client.router import Router
from app.rig.kinova.client.transport import TcpTransport, UdpTransport

Asked = TypeVar("Asked")
Answered = TypeVar("Answered")

_AS_IT_HAPPENS = 3
"""`NotificationType` of `Common.proto`."""
_UNANSWERED = 40
"""Unanswered calls over UDP in succession that count as a lost connection, and not as lost datagrams."""


@final
class OwnLink:
    """A `Link` in pure Python."""

    name = "dipac"

    def __init__(self, address: Address) -> None:
        self._address = address
        self._lock = threading.Lock()
        self._commands: Router | None = None
        self._cyclic: Router | None = None
        self._topics: dict[int, type[Any]] = {}
        self._unanswered = 0

    def open(self) -> None:
        """Connect anew; closes an earlier connection. Raises LinkLost and Refused."""
        self.close()
        address = self._address
        info = SessionInfo(
            username=address.username,
            password=address.password,
            session_inactivity_timeout=round(1e3 * address.closes_after_s),
            connection_inactivity_timeout=round(1e3 * address.stops_after_s),
        )
        with contextlib.ExitStack() as undone:
            commands = Router(TcpTransport(address.host, address.tcp_port), "commands")
            undone.callback(commands.close)
            commands.create_session(info)
            cyclic = Router(UdpTransport(address.host, address.udp_port), "feedback")
            undone.callback(cyclic.close)
            cyclic.create_session(info)
            with self._lock:
                self._commands, self._cyclic, self._topics, self._unanswered = commands, cyclic, {}, 0
            undone.pop_all()

    def close(self) -> None:
        """End both sessions."""
        with self._lock:
            routers = [self._commands, self._cyclic]
            self._commands = self._cyclic = None
        for router in routers:
            if router is not None:
                router.close()

    def cut(self) -> None:
        """Silence both sessions from now on."""
        for router in (self._commands, self._cyclic):
            if router is not None:
                router.cut()

    @property
    def loss_reason(self) -> str:
        """Reason for the loss of either session."""
        commands, cyclic = self._commands, self._cyclic
        if commands is None or cyclic is None:
            return "There is no connection to the arm."
        if self._unanswered >= _UNANSWERED:
            return f"The arm has not answered {self._unanswered} calls for feedback over UDP, one after the other."
        return commands.lost or cyclic.lost

    def call(self, call: Call[Asked, Answered], asked: Asked, *, timeout_s: float | None = None) -> Answered:
        """Make a call on the session of its service."""
        router = self._cyclic if call.service == Service.BASE_CYCLIC else self._commands
        if router is None:
            raise LinkLost(self.loss_reason)
        if router is not self._cyclic:
            return router.call(call, asked, timeout_s)
        try:
            answer = router.call(call, asked, timeout_s)
        except NoAnswer:
            self._unanswered += 1
            raise
        self._unanswered = 0
        return answer

    def tell(self, call: Call[Asked, Any], asked: Asked) -> None:
        """Send a call on the command session, whose silence is what stops the arm."""
        if (router := self._commands) is None:
            raise LinkLost(self.loss_reason)
        router.tell(call, asked)

    def subscribe(self, topic: Topic[Any]) -> None:
        """Subscribe on the command session."""
        handle = self.call(topic.call, NotificationOptions(type=_AS_IT_HAPPENS))
        self._topics[handle.identifier] = topic.told

    def take_notifications(self) -> list[object]:
        """Notifications decoded in the caller's thread, not the receiving one, so that the caller may make calls."""
        router, messages = self._commands, list[object]()
        while router is not None and router.notifications:
            frame = router.notifications.popleft()
            if (told := self._topics.get(frame.message)) is not None:
                messages.append(decode(told, frame.payload))
        return messages
