"""Kinova's own client behind the same port; it is imported on demand, and not needed otherwise.

Properties that this code works around (docs/kinova.md): its calls wait 10 s unless each has a timeout; all routers
share one table of notifications, so that the client of `Base` may be on one router only; its callbacks run on the
receiving thread; its stream spins silently where the peer has closed; its timeouts are no errors of its own; and it
takes no port for feedback but 10001.
"""

import contextlib
import importlib
import threading
from collections import deque
from concurrent.futures import TimeoutError as NothingCame
from functools import partial
from typing import Any, TypeVar, final

from app.core.errors import PreflightError
from app.rig.kinova.api.calls import CREATE_SESSION, REFRESH_FEEDBACK, Call, Service, Topic
from app.rig.kinova.api.errors import LinkLost, NoAnswer, Refused
from app.rig.kinova.api.protobuf import decode, encode
from app.rig.kinova.api.session import Empty, SessionInfo
from app.rig.kinova.client.link import Address

Asked = TypeVar("Asked")
Answered = TypeVar("Answered")

INSTALL = (
    "take the wheel of kortex_api for your firmware (2.6.0 or newer) from Kinova's artifact server, which the readme "
    "of Kinovarobotics/kortex on GitHub links to, then: pip install protobuf==3.20.3 deprecated==1.2.7 && "
    "pip install --no-deps kortex_api-*.whl"
)
_KEPT, _UNANSWERED, _EVENT, _CLOSE_S = 1000, 40, 3, 0.3
_ALIVE_S = 0.6
"""Session timeout that its thread needs, which sends a sign of life every 150 ms."""


@final
class OfficialLink:
    """A `Link` over `kortex_api`. Raises PreflightError where that is not installed."""

    name = "kortex_api"

    def __init__(self, address: Address) -> None:
        self._address, self._api = address, _Api()
        self._lock, self._lost = threading.Lock(), "There is no connection to the arm."
        self._ends = contextlib.ExitStack()
        self._wires: list[Any] = []
        self._clients: dict[Service, Any] = {}
        self._session: Any = None
        self._told = deque[object](maxlen=_KEPT)
        self._unanswered = 0

    def open(self) -> None:
        """Connect anew. Raises LinkLost and Refused."""
        self.close()
        commands = self._router("TCP", self._address.tcp_port)
        cyclic = self._router("UDP", self._address.udp_port)
        self._clients = {
            Service.BASE: self._api.stub("Base", commands),
            Service.CONTROL_CONFIG: self._api.stub("ControlConfig", commands),
            Service.BASE_CYCLIC: self._api.stub("BaseCyclic", cyclic),
        }
        self._lost, self._unanswered = "", 0

    def close(self) -> None:
        """End both sessions."""
        with self._lock:
            ends, self._ends = self._ends, contextlib.ExitStack()
        self._clients, self._lost, self._wires = {}, self._lost or "The connection was closed.", []
        ends.close()
        self._told.clear()

    def cut(self) -> None:
        """Silence its keep-alive thread by closing its transport."""
        self._lost = self._lost or "The connection was cut from here."
        for wire in self._wires:
            _quietly(wire.disconnect)

    @property
    def loss_reason(self) -> str:
        """Reason for the lost connection, from timeouts alone: this client does not report a closed peer."""
        if self._unanswered >= _UNANSWERED:
            return f"The arm has not answered {self._unanswered} calls for feedback over UDP, one after the other."
        return self._lost

    def call(self, call: Call[Asked, Answered], asked: Asked, *, timeout_s: float | None = None) -> Answered:
        """Make a call by the stub's method of its name."""
        if self._lost or (client := self._clients.get(call.service)) is None:
            raise LinkLost(self._lost)
        method, arguments = getattr(client, call.name), self._api.arguments(call, asked)
        options = self._api.options(call.timeout_s if timeout_s is None else timeout_s)
        answer = self._invoke(call, partial(method, *arguments, options=options))
        return decode(call.answered, answer.SerializeToString() if answer is not None else b"")

    def tell(self, call: Call[Asked, Any], asked: Asked) -> None:  # noqa: ARG002 - the port's
        """No-op: this client keeps its session alive itself, and no other call is made without waiting for an answer.

        Its thread does so every 150 ms for as long as the process lives (`SessionManager`): the arm does not notice a
        loop that hangs, which is left to the watchdog of the arm's process.
        """
        if self._lost:
            raise LinkLost(self._lost)

    def subscribe(self, topic: Topic[Any]) -> None:
        """Subscribe with a callback that only stores: a call from within it would deadlock."""
        asked = self._api.message("Common", "NotificationOptions")
        asked.type = _EVENT
        method = getattr(self._clients[Service.BASE], topic.call.name)
        told = self._told

        def keep(message: Any) -> None:
            told.append(decode(topic.told, message.SerializeToString()))

        options = self._api.options(topic.call.timeout_s)
        self._invoke(topic.call, partial(method, keep, asked, options=options))

    def take_notifications(self) -> list[object]:
        """Notifications since the last call, in order."""
        return [self._told.popleft() for _ in range(len(self._told))]

    def _invoke(self, call: Call[Any, Any], made: partial[Any]) -> Any:
        """Result of a call, with the client's errors converted to ours."""
        cyclic = call is REFRESH_FEEDBACK
        try:
            answer = made()
        except NothingCame:
            error = NoAnswer(f"The arm did not answer {call.name} in its time.")
            self._unanswered += cyclic
            self._lost = self._lost if cyclic else str(error)
            raise error from None
        except self._api.refused as error:
            raise Refused(call.name, int(error.get_error_code()), int(error.get_error_sub_code())) from None
        except self._api.failed as error:
            # Not every version gives a code for all of its own errors, although its documentation says so.
            self._lost = self._lost or f"Kinova's client could not make the call {call.name}: {error}"
            raise LinkLost(self._lost) from None
        self._unanswered = 0 if cyclic else self._unanswered
        return answer

    def _router(self, kind: str, port: int) -> Any:
        """A session over one transport, ended with the others."""
        address, transport = self._address, self._api.transport(kind)
        router = self._api.router(transport)
        try:
            transport.connect(address.host, port)
        except OSError as error:
            raise LinkLost(f"No arm answers at {address.host}, {kind} port {port} ({error}).") from None
        self._ends.callback(_quietly, transport.disconnect)
        self._wires.append(transport)
        info = SessionInfo(
            username=address.username,
            password=address.password,
            session_inactivity_timeout=round(1e3 * address.closes_after_s),
            connection_inactivity_timeout=round(1e3 * max(address.stops_after_s, _ALIVE_S)),
        )
        sessions = self._api.sessions(router)
        asked = self._api.message("Session", "CreateSessionInfo")
        asked.ParseFromString(encode(info))
        create = CREATE_SESSION
        self._invoke(create, partial(sessions.CreateSession, asked, options=self._api.options(create.timeout_s)))
        self._ends.callback(router.SetActivationStatus, False)
        self._ends.callback(_quietly, partial(sessions.CloseSession, options=self._api.options(_CLOSE_S)))
        return router


def _quietly(end: Any) -> None:
    """End without errors: the arm may be gone already."""
    with contextlib.suppress(Exception):
        end()


def _ignore_error(_: object) -> None:
    """Ignore a router's own errors: unanswered calls report the same."""


@final
class _Api:
    """The parts of `kortex_api` by name. Untyped, so everything of it is `Any`."""

    def __init__(self) -> None:
        try:
            self._transports = {kind: self._part(f"{kind}Transport", f"{kind}Transport") for kind in ("TCP", "UDP")}
            self._router = self._part("RouterClient", "RouterClient")
            self._options = self._part("RouterClient", "RouterClientSendOptions")
            self.sessions = self._part("SessionManager", "SessionManager")
            self.refused = self._part("Exceptions.KServerException", "KServerException")
            self.failed = self._part("Exceptions.KException", "KException")
        except ImportError as error:
            raise PreflightError(f"Kinova's client cannot be imported ({error}): {INSTALL}.") from None
        except (TypeError, AttributeError) as error:
            raise PreflightError(f"Kinova's client does not run with this protobuf ({error}): {INSTALL}.") from None

    def transport(self, kind: str) -> Any:
        """A transport, TCP or UDP."""
        return self._transports[kind]()

    def router(self, transport: Any) -> Any:
        """A router over a transport; its failures show as unanswered calls."""
        return self._router(transport, _ignore_error)

    def stub(self, service: str, router: Any) -> Any:
        """The client of a service."""
        return self._part(f"autogen.client_stubs.{service}ClientRpc", f"{service}Client")(router)

    def options(self, timeout_s: float) -> Any:
        """Options with this timeout. Fresh for each call: the client's defaults are one shared object."""
        options = self._options()
        options.timeout_ms = round(1e3 * timeout_s)
        return options

    def message(self, module: str, name: str) -> Any:
        """An empty message."""
        return self._part(f"autogen.messages.{module}_pb2", name)()

    def arguments(self, call: Call[Any, Any], asked: object) -> tuple[Any, ...]:
        """Arguments of a stub's method: none for an empty message, else the message in its own class."""
        if isinstance(asked, Empty):
            return ()
        module = "ControlConfig" if call.service == Service.CONTROL_CONFIG else "Base"
        message = self.message(module, _THEIR_NAMES.get(type(asked).__name__, type(asked).__name__))
        message.ParseFromString(encode(asked))
        return (message,)

    def _part(self, module: str, name: str) -> Any:
        return getattr(importlib.import_module(f"kortex_api.{module}"), name)


_THEIR_NAMES = {"InverseKinematicsData": "IKData", "Handle": "ProtectionZoneHandle"}
"""Kinova's names of messages where ours differ."""
