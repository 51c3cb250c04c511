"""What a browser may say to the console: the rules for messages through its websocket. Pure.

Viser trusts its page: of a message that makes no sense it prints a traceback, and a number that is not finite goes as
it came to whoever reads the widget. So every message is looked at before viser sees it.
"""

import math
from collections.abc import Callable
from typing import Any, Final, cast

import msgspec

SPOKEN: Final = frozenset(
    {
        "CommandTriggerMessage",
        "FileTransferPart",
        "FileTransferStartUpload",
        "GuiButtonHoldMessage",
        "GuiFormDirtyMessage",
        "GuiFormSubmitMessage",
        "GuiUpdateMessage",
        "LocalStorageGetItemResponseMessage",
        "SceneNodeClickMessage",
        "SceneNodeDragMessage",
        "ScenePointerMessage",
        "TransformControlsDragEndMessage",
        "TransformControlsDragStartMessage",
        "TransformControlsUpdateMessage",
        "ViewerCameraMessage",
    }
)
"""What viser's page says of itself. Not among them: asking for a public tunnel, and what only a server says."""

STEADY_HZ, BURST = 200.0, 400.0
"""Messages of one browser: a camera that is turned and a handle that is dragged send sixty a second each."""
_DEEPEST = 32


def refusal(data: bytes, understood: Callable[[bytes], bool]) -> str | None:
    """Why this message of a browser is not passed on, or None. `understood`: whether viser can make something of it."""
    try:
        said: Any = msgspec.msgpack.decode(data)
    except (msgspec.MsgspecError, ValueError, RecursionError):
        return "it is no message"
    kind = cast(dict[str, Any], said).get("type") if isinstance(said, dict) else None
    if not isinstance(kind, str) or kind not in SPOKEN:
        return "no page says such a thing"
    if not _sound(said, _DEEPEST):
        return "it holds a number that is not finite, or is nested too deeply"
    return None if understood(data) else "its fields make no sense"


def _sound(value: Any, deepest: int) -> bool:
    match value:
        case float():
            return math.isfinite(value)
        case list():
            return deepest > 0 and all(_sound(item, deepest - 1) for item in cast(list[Any], value))
        case dict():
            return deepest > 0 and all(_sound(item, deepest - 1) for item in cast(dict[Any, Any], value).values())
        case _:
            return True
