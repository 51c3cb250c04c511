"""Who may command, and what the program does by itself."""

from dataclasses import dataclass
from typing import Final, Literal, TypeAlias, final, get_args

from app.core.messages import Message


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Lease(Message):
    """From now on `holder` alone may command; nobody has control where that is empty. STOP is everybody's."""

    holder: str
    why: str


ModeName: TypeAlias = Literal["idle", "teleoperate", "plan only", "approve each", "automatic"]
"""What the program does by itself: nothing; what is jogged; plans; plans and motions once approved; both."""
MODES: Final[tuple[ModeName, ...]] = get_args(ModeName)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Mode(Message):
    """From now on the program is in this mode. `motions`: how many more it makes by itself while it is automatic.

    `why`: who asked for it, or what led to it. A fault is no mode of these: the arm's state or a fatal `Fault` tells.
    """

    mode: ModeName
    motions: int = 0
    why: str = ""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ModeRequest(Message):
    """Somebody wants another mode; `motions` is for automatic alone.

    `confirmed`: asked whether they shall be made without approval on a real arm, whoever wants that has said yes.
    """

    operator: str
    mode: ModeName
    motions: int = 0
    confirmed: bool = False


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class EndRequest(Message):
    """Somebody wants the session to end, its recording closed."""

    operator: str
