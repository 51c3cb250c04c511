"""The jog panel below the scene: buttons to hold, speed, frame. `jog.js` shows it."""

from collections.abc import Iterable
from typing import Final, TypeAlias

_Button: TypeAlias = tuple[str, int, str, str]
"""Axis, sign, label and key."""

_WAYS: Final[tuple[_Button, ...]] = (
    ("z", 1, "up", "R"),
    ("x", -1, "x \N{MINUS SIGN}", "W"),
    ("z", -1, "down", "F"),
    ("y", -1, "y \N{MINUS SIGN}", "A"),
    ("x", 1, "x +", "S"),
    ("y", 1, "y +", "D"),
)
_TURNS: Final[tuple[_Button, ...]] = (
    ("yaw", 1, "turn left", "Q"),
    ("yaw", -1, "turn right", "E"),
    ("grip", -1, "close", "G"),
    ("grip", 1, "open", "H"),
)


def drawer() -> str:
    """HTML of the panel, hidden at first."""
    return (
        '<section id="dp-jog" aria-label="Move the tool by hand" hidden>'
        f'<div class="dp-jog-keys">{_buttons(_WAYS)}</div><div class="dp-jog-keys two">{_buttons(_TURNS)}</div>'
        '<button type="button" data-towards title="Hold to go to the handle with the arrows in the scene">'
        "Go there<kbd>hold</kbd></button>"
        '<div class="dp-jog-how">'
        '<label>Speed <input id="dp-jog-speed" type="range" min="5" max="100" value="30"></label>'
        '<div>Along <label><input type="radio" name="dp-jog-frame" value="world" checked> the world</label>'
        '<label><input type="radio" name="dp-jog-frame" value="tool"> the tool</label></div>'
        '<div id="dp-jog-at" title="Where the tool is, in the robot\'s base frame"></div>'
        '<div id="dp-jog-says" role="status"></div></div></section>'
    )


def _buttons(buttons: Iterable[_Button]) -> str:
    return "".join(
        f'<button type="button" data-axis="{axis}" data-sign="{sign}">{label}<kbd>{key}</kbd></button>'
        for axis, sign, label, key in buttons
    )
