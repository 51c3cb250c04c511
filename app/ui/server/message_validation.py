"""Validation of messages from browsers through the websocket. Pure.

Viser trusts its page: on an invalid message it prints a traceback, and it passes a non-finite number on to the reader
of the widget. So every message is checked before viser sees it.
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
"""Message types that viser's page sends for the console's widgets. A new kind of widget may need another."""
AIM, DRAFT, ENDS = "/aim", "/draft/handle", ("/edit/start", "/edit/end")
DRAGGED: Final = (AIM, DRAFT, *ENDS)
"""Handles in the scene that a browser may drag, by name."""
_FARTHEST = 3.0
"""Largest coordinate of a dragged handle from the robot's base [m]; no number of a quaternion exceeds 1."""
_PLACES: Final = (("position", 3), ("wxyz", 4))
_VALUE: Final = frozenset({"value"})
"""Attributes of a widget that a browser may change: viser would set any other as well, callbacks included."""

STEADY_HZ, BURST = 200.0, 400.0
"""Rate limit of one browser's messages: a turned camera and a dragged handle send sixty a second each."""
MOST_BYTES: Final = 64 * 1024
_DEEPEST, _MOST_VALUES = 8, 1000
"""Limits of nesting and size: the page's own messages are flat and short. All are read in the thread that handles
STOP."""


def refusal(data: bytes, understood: Callable[[bytes], bool]) -> str | None:
    """Reason why a browser's message is not passed on, or None. `understood`: True where viser can parse it."""
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
    """True for a drag of one of our handles in the shared scene, to a position near the table where it gives one."""
    known = fields.get("name") in DRAGGED and fields.get("owner", "") == ""
    return known and all(_vector(fields[key], length) for key, length in _PLACES if key in fields)


def _vector(said: Any, length: int) -> bool:
    numbers = cast(list[Any], said) if isinstance(said, list) else []
    return len(numbers) == length and all(type(n) in (int, float) and abs(n) <= _FARTHEST for n in numbers)


def _sound(message: Any) -> bool:
    """True where every number is finite, and their number and nesting are limited."""
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
