"""What a browser may say to the console: the rules for messages through its websocket. Pure.

Viser trusts its page: of a message that makes no sense it prints a traceback, and a number that is not finite goes as
it came to whoever reads the widget. So every message is looked at before viser sees it.
"""

import math
from collections.abc import Callable
from typing import Any, Final, cast

import msgspec

_DRAGS: Final = frozenset(
    {"TransformControlsUpdateMessage", "TransformControlsDragStartMessage", "TransformControlsDragEndMessage"}
)
SPOKEN: Final = _DRAGS | {
    "GuiFormDirtyMessage",
    "GuiFormSubmitMessage",
    "GuiUpdateMessage",
    "ScenePointerMessage",
    "ViewerCameraMessage",
}
"""What viser's page says of the widgets that the console has. A new kind of widget may want another word."""
AIM, DRAFT, ENDS = "/aim", "/draft/handle", ("/edit/start", "/edit/end")
DRAGGED: Final = (AIM, DRAFT, *ENDS)
"""What a browser may drag in the scene, by its name there."""
_FARTHEST = 3.0
"""No handle is dragged farther from the robot's base on purpose [m]; of a turn no number is greater than 1."""
_PLACES: Final = (("position", 3), ("wxyz", 4))
_VALUE: Final = frozenset({"value"})
"""What a browser may change of a widget: viser would set any other attribute of it as well, its callbacks too."""

STEADY_HZ, BURST = 200.0, 400.0
"""Messages of one browser: a camera that is turned and a handle that is dragged send sixty a second each."""
MOST_BYTES: Final = 64 * 1024
_DEEPEST, _MOST_VALUES = 8, 1000
"""The page's own messages are flat and short. All of this is read in the thread that STOP comes in by."""


def refusal(data: bytes, understood: Callable[[bytes], bool]) -> str | None:
    """Why this message of a browser is not passed on, or None. `understood`: whether viser can make something of it."""
    try:
        said: Any = msgspec.msgpack.decode(data)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return "it is no message"
    if not isinstance(said, dict):
        return "it is no message"
    fields = cast(dict[Any, Any], said)
    kind = fields.get("type")
    if not isinstance(kind, str) or kind not in SPOKEN:
        return "no page says such a thing"
    if not _sound(fields):
        return "it holds a number that is not finite, too much, or is nested too deeply"
    updates = fields.get("updates", {})
    if not isinstance(updates, dict) or not _VALUE.issuperset(cast(dict[Any, Any], updates)):
        return "a browser changes the value of a widget and nothing else of it"
    if kind in _DRAGS and not _drags(fields):
        return "a browser drags the console's handles over the table and nothing else"
    return None if understood(data) else "its fields make no sense"


def _drags(fields: dict[Any, Any]) -> bool:
    """Whether it is of one of our handles, in the scene that all share, to a place near the table where it says one."""
    known = fields.get("name") in DRAGGED and fields.get("owner", "") == ""
    return known and all(_vector(fields[key], length) for key, length in _PLACES if key in fields)


def _vector(said: Any, length: int) -> bool:
    numbers = cast(list[Any], said) if isinstance(said, list) else []
    return len(numbers) == length and all(type(n) in (int, float) and abs(n) <= _FARTHEST for n in numbers)


def _sound(message: Any) -> bool:
    """Whether every number is finite, and there are not too many of them in too many layers."""
    layer, counted = [message], 0
    for _ in range(_DEEPEST):
        inner = list[Any]()
        for value in layer:
            counted += 1
            if isinstance(value, float) and not math.isfinite(value):
                return False
            if isinstance(value, list):
                inner += cast(list[Any], value)
            elif isinstance(value, dict):
                inner += cast(dict[Any, Any], value).values()
            if counted + len(inner) > _MOST_VALUES:
                return False
        layer = inner
    return not layer
