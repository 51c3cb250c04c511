"""Who is connected: sessions, when they were last heard, and what they subscribed to."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import final

from app.rig.kinova.session import SessionInfo

USER, PASSWORD = "admin", "admin"
"""What every Gen3 is delivered with."""
WRONG_PASSWORD, NO_USER, NO_SESSION = 15, 16, 12
"""Sub errors of `Errors.proto`."""


@final
@dataclass(kw_only=True)
class Session:
    """One of them; `halted` once it was silent for so long that what it moves is stopped.

    `heard` since the last tick; by ticks it is silent, so that an arm that itself did not run blames nobody.
    """

    number: int
    closes_after_s: float
    stops_after_s: float
    silence_s: float = 0.0
    heard: bool = True
    address: object = None
    topics: dict[int, int] = field(default_factory=dict[int, int])
    """Of subscriptions: the function of the topic to the handle that names it."""
    halted: bool = False


@final
class Sessions:
    """All that are open."""

    def __init__(self) -> None:
        self._open: dict[int, Session] = {}
        self._made = 0

    def __iter__(self) -> Iterator[Session]:
        return iter(tuple(self._open.values()))

    def get(self, number: int) -> Session | None:
        """The one of that number, where it is open."""
        return self._open.get(number)

    def refused(self, info: SessionInfo) -> int:
        """Why such a session is not opened: a sub error, 0 where it would be."""
        if info.username != USER:
            return NO_USER
        return 0 if info.password == PASSWORD else WRONG_PASSWORD

    def create(self, info: SessionInfo, address: object) -> Session:
        """A new one."""
        self._made = self._made % 0xFFFF + 1
        session = Session(
            number=self._made,
            closes_after_s=info.session_inactivity_timeout / 1e3,
            stops_after_s=info.connection_inactivity_timeout / 1e3,
            address=address,
        )
        self._open[session.number] = session
        return session

    def close(self, number: int) -> None:
        """End it."""
        self._open.pop(number, None)

    def hear(self, session: Session) -> None:
        """Note that it has said something."""
        session.heard, session.halted = True, False

    def silent(self, duration_s: float) -> list[Session]:
        """Those whose movements are to be stopped after a tick; those that are silent for longer still are closed."""
        found = list[Session]()
        for session in self:
            session.silence_s = 0.0 if session.heard else session.silence_s + duration_s
            session.heard = False
            if 0 < session.stops_after_s < session.silence_s and not session.halted:
                session.halted = True
                found.append(session)
            if 0 < session.closes_after_s < session.silence_s:
                self.close(session.number)
        return found
