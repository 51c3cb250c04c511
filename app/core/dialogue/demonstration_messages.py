"""Messages of demonstrations: the one being recorded, and the number made so far."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, final

from app.core.messages import Message

TakeState: TypeAlias = Literal["recording", "success", "failure", "discarded"]


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Take(Message):
    """State of demonstration `number` of this session, recorded at `path`; `succeeded` counts successes."""

    number: int
    path: str
    state: TakeState
    transitions: int
    succeeded: int
