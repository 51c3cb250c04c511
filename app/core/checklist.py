"""What has to be right before anything real moves for the first time in a session."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, final

from app.core.messages import Message

CheckedBy: TypeAlias = Literal["program", "operator"]


@final
@dataclass(frozen=True, kw_only=True)
class CheckItem:
    """One thing that has to be so, in words. `said`: what was found, or who confirmed it."""

    key: str
    text: str
    by: CheckedBy
    right: bool
    said: str = ""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Checklist(Message):
    """How it stands; no motion is approved before it is `passed`, which it then is for the whole session.

    `by_hand`: the tool may be moved by hand before: what lacks is only of what the cameras say.
    """

    items: tuple[CheckItem, ...]
    passed: bool
    by_hand: bool = False


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ChecklistRequest(Message):
    """Somebody confirms that the item called `key` is so."""

    operator: str
    key: str
