"""Checklist that must be complete before the first real motion of a session."""

from dataclasses import dataclass
from typing import Literal, TypeAlias, final

from app.core.messages import Message

CheckedBy: TypeAlias = Literal["program", "operator"]


@final
@dataclass(frozen=True, kw_only=True)
class CheckItem:
    """One condition, in words. `said`: the measured state, or the operator who confirmed it."""

    key: str
    text: str
    by: CheckedBy
    right: bool
    said: str = ""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Checklist(Message):
    """State of the checklist; no motion is approved until it is `passed`, which then holds for the whole session.

    `by_hand`: jogging is allowed before that, as only items about the cameras are open.
    """

    items: tuple[CheckItem, ...]
    passed: bool
    by_hand: bool = False


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class ChecklistRequest(Message):
    """An operator's confirmation of the item called `key`."""

    operator: str
    key: str
