"""Sessions of the emulated arm: their silence and their subscriptions."""

from collections.abc import Iterator
from dataclasses import dataclass, field
from typing import final

from app.rig.kinova.api.session import SessionInfo

USER, PASSWORD = "admin", "admin"
"""Credentials that every Gen3 is delivered with."""
WRONG_PASSWORD, NO_USER, NO_SESSION = 15, 16, 12
"""Sub errors of `Errors.proto`."""


@final
@dataclass(kw_only=True)
class ArmSession:
    """An open session; `halted` once its silence has stopped its motions.

    `heard` since the last tick; silence is counted in ticks, so that a delay of the emulator itself does not count.
    """

    number: int
    closes_after_s: float
    stops_after_s: float
    silence_s: float = 0.0
    heard: bool = True
    address: object = None
    topics: dict[int, int] = field(default_factory=dict[int, int])
    """Subscriptions: the function of each topic to its handle."""
    halted: bool = False


@final
class Sessions:
    """The open sessions."""

    def __init__(self) -> None:
        self._open: dict[int, ArmSession] = {}
        self._made = 0

    def __iter__(self) -> Iterator[ArmSession]:
        return iter(tuple(self._open.values()))

    def get(self, number: int) -> ArmSession | None:
        """The open session of that number, None where there is none."""
        return self._open.get(number)

    def refusal_code(self, info: SessionInfo) -> int:
        """Sub error with which such a session is refused, 0 where it is accepted."""
        if info.username != USER:
            return NO_USER
        return 0 if info.password == PASSWORD else WRONG_PASSWORD

    def create(self, info: SessionInfo, address: object) -> ArmSession:
        """Open a session."""
        self._made = self._made % 0xFFFF + 1
        session = ArmSession(
            number=self._made,
            closes_after_s=info.session_inactivity_timeout / 1e3,
            stops_after_s=info.connection_inactivity_timeout / 1e3,
            address=address,
        )
        self._open[session.number] = session
        return session

    def close(self, number: int) -> None:
        """Close the session."""
        self._open.pop(number, None)

    def hear(self, session: ArmSession) -> None:
        """Note a sign of life of the session."""
        session.heard, session.halted = True, False

    def silent(self, duration_s: float) -> list[ArmSession]:
        """Sessions whose motions must stop after this tick; those silent for longer still are closed."""
        found = list[ArmSession]()
        for session in self:
            session.silence_s = 0.0 if session.heard else session.silence_s + duration_s
            session.heard = False
            if 0 < session.stops_after_s < session.silence_s and not session.halted:
                session.halted = True
                found.append(session)
            if 0 < session.closes_after_s < session.silence_s:
                self.close(session.number)
        return found
