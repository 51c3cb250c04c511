"""Messages of control: the lease of command, the mode of operation, and requests to change them."""

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias, final, get_args

from app.core.messages import Message


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Lease(Message):
    """Grant of control: from now on `holder` alone may command, nobody where it is empty. STOP stays open to all."""

    holder: str
    why: str


ModeName: TypeAlias = Literal["idle", "teleoperate", "plan only", "approve each", "automatic"]
"""Mode of operation: nothing; jogging; planning; planning and approved motions; planning and motions unapproved."""
MODES: Final[tuple[ModeName, ...]] = get_args(ModeName)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Mode(Message):
    """Mode of operation from now on. `motions`: motions left to make without approval while it is automatic.

    `why`: the operator who asked for it, or the event that led to it. A fault is not a mode: the arm's state or a fatal
    `Fault` tells of it.
    """

    mode: ModeName
    motions: int = 0
    why: str = ""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ModeRequest(Message):
    """An operator's request for another mode; `motions` is for automatic alone.

    `confirmed`: the operator has said yes to unapproved motions on a real arm when asked.
    """

    operator: str
    mode: ModeName
    motions: int = 0
    confirmed: bool = False


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class EndRequest(Message):
    """An operator's request to end the session and close its recording."""

    operator: str
