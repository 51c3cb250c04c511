"""Port for the calls to an arm: this program's own client, or Kinova's."""

from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar, final

from app.rig.kinova.api.calls import Call, Topic

Asked = TypeVar("Asked")
Answered = TypeVar("Answered")


@final
@dataclass(frozen=True, kw_only=True)
class Address:
    """Network address and credentials of an arm; the defaults are those that every Gen3 is delivered with.

    After `stops_after_s` of silence of a session, the arm itself stops that session's motions
    (`connection_inactivity_timeout`); after `closes_after_s` it closes the session.
    """

    host: str = "192.168.1.10"
    tcp_port: int = 10000
    udp_port: int = 10001
    username: str = "admin"
    password: str = field(default="admin", repr=False)
    stops_after_s: float = 0.15
    """Timeout of a lost connection, which nothing else ends. With up to a cycle of the arm and braking from 0.1 m/s
    it is at rest within 250 ms; users run real ones with 0.1 s. Keep-alives are sent every 25 ms (`driver.ALIVE_S`)."""
    closes_after_s: float = 10.0


class Link(Protocol):
    """A connection of two sessions: commands over TCP, feedback over UDP. All may be called from any thread."""

    @property
    def name(self) -> str:
        """Name of the client."""
        ...

    def open(self) -> None:
        """Connect or reconnect. Raises LinkLost where nothing answers and Refused where the arm refuses."""
        ...

    def close(self) -> None:
        """End both sessions and the connection. Never raises, and may be called at any time."""
        ...

    def cut(self) -> None:
        """Drop the connection silently, as a pulled cable does. Never raises."""
        ...

    @property
    def loss_reason(self) -> str:
        """Reason why the connection is unusable; empty while it is usable."""
        ...

    def call(self, call: Call[Asked, Answered], asked: Asked, *, timeout_s: float | None = None) -> Answered:
        """Make a call and wait for its answer, for the call's timeout or `timeout_s`.

        Calls of several threads do not wait for each other's answers. Raises Refused, NoAnswer and LinkLost.
        """
        ...

    def tell(self, call: Call[Asked, Any], asked: Asked) -> None:
        """Make a call without waiting for its answer. Raises LinkLost, also where answers have failed for long."""
        ...

    def subscribe(self, topic: Topic[Any]) -> None:
        """Subscribe to a topic for `told`, until the connection ends."""
        ...

    def take_notifications(self) -> list[object]:
        """Notifications since the last call, in order."""
        ...
