"""Who may command: at most one of those who look on."""

from dataclasses import dataclass
from typing import final

from app.core.messages import Message


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Lease(Message):
    """From now on `holder` alone may decide and resume; nobody has it where that is empty. STOP is everybody's."""

    holder: str
    why: str
