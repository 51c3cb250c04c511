"""What carries calls to an arm, as a small port: this program's own client, or Kinova's."""

from dataclasses import dataclass, field
from typing import Any, Protocol, TypeVar, final

from app.rig.kinova.calls import Call, Topic

Asked = TypeVar("Asked")
Answered = TypeVar("Answered")


@final
@dataclass(frozen=True, kw_only=True)
class Address:
    """Where an arm is, and who calls: what every Gen3 is delivered with, by default.

    After `stops_after_s` in which a session says nothing, the arm itself stops what that session moves
    (`connection_inactivity_timeout`); after `closes_after_s` it closes the session.
    """

    host: str = "192.168.1.10"
    tcp_port: int = 10000
    udp_port: int = 10001
    username: str = "admin"
    password: str = field(default="admin", repr=False)
    stops_after_s: float = 0.15
    """Nothing else ends a motion whose connection is gone. With up to a cycle of the arm and braking from 0.1 m/s it is
    at rest within 250 ms; users run real ones with 0.1 s. Life is shown every 25 ms (`driver.ALIVE_S`)."""
    closes_after_s: float = 10.0


class Link(Protocol):
    """A connection of two sessions: commands over TCP, feedback over UDP. All may be called from any thread."""

    @property
    def name(self) -> str:
        """Which client this is."""
        ...

    def open(self) -> None:
        """Connect, or connect again. Raises LinkLost where nobody answers and Refused where the arm will not."""
        ...

    def close(self) -> None:
        """End both sessions, where they stand, and the connection. Never raises, and may be called at any time."""
        ...

    def cut(self) -> None:
        """Drop the connection without a word, as a cable does that is pulled. Never raises."""
        ...

    @property
    def lost(self) -> str:
        """Why the connection is of no use any more; empty while it is."""
        ...

    def call(self, call: Call[Asked, Answered], asked: Asked, *, timeout_s: float | None = None) -> Answered:
        """Make a call and wait for its answer, for as long as the call has patience or `timeout_s`.

        Calls of several threads do not wait for each other's answers. Raises Refused, NoAnswer and LinkLost.
        """
        ...

    def tell(self, call: Call[Asked, Any], asked: Asked) -> None:
        """Make a call whose answer nobody waits for. Raises LinkLost, also where for long none has come any more."""
        ...

    def subscribe(self, topic: Topic[Any]) -> None:
        """Have `told` hear of it, until the connection ends."""
        ...

    def told(self) -> list[object]:
        """What was heard since this was asked last, in order."""
        ...
