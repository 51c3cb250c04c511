"""The checklist before the first motion: the program's findings, and a button for each item to confirm by hand."""

from html import escape
from typing import Any, Final, final

import viser

from app.core.dialogue.checklist import CheckItem, ChecklistRequest
from app.core.messages import fresh_id
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.decision import operator
from app.ui.parts.operator_controller import OperatorController

_CONFIRM: Final = {
    "emergency": "I tried the emergency stop",
    "clear": "Nobody is within reach",
    "tool": "The tool is right",
    "limits": "The limits fit the cell",
}
_MARKS: Final = {True: "<b class='dp-good'>✓</b>", False: "<b class='dp-warn'>○</b>"}


def card(state: ConsoleState) -> str:
    """Card of the checklist's items and their state."""
    if state.checklist is None:
        return ""
    return f'<div class="dp">{"".join(map(_line, state.checklist.items))}</div>'


def _line(item: CheckItem) -> str:
    said = f" <small>{escape(item.said)}</small>" if item.said else ""
    return f"<p class='dp-check'>{_MARKS[item.right]} <span>{escape(item.text)}{said}</span></p>"


@final
class ChecklistForm:
    """Folder shown while the checklist is open. Painted by the painter's thread alone."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController) -> None:
        self._controller = controller
        self._place = gui.add_folder("Before the first motion", visible=False)
        self._buttons = dict[str, viser.GuiButtonHandle]()
        with self._place:
            self._said = gui.add_html("")
            for key, label in _CONFIRM.items():
                self._buttons[key] = gui.add_button(label, color="orange", icon=viser.Icon.CHECKBOX, visible=False)
                self._buttons[key].on_click(lambda event, key=key: self._confirm(event, key))

    def paint(self, state: ConsoleState) -> None:
        """Update it to the state."""
        is_open = not state.is_cleared
        if self._place.visible != is_open:
            self._place.visible = is_open
        content = card(state)
        if content != self._said.content:
            self._said.content = content
        wanted = {item.key for item in state.checklist.items if not item.right} if state.checklist else set[str]()
        for key, button in self._buttons.items():
            if button.visible != (key in wanted):
                button.visible = key in wanted

    def _confirm(self, event: viser.GuiEvent[Any], key: str) -> None:
        now_s = self._controller.now()
        self._controller.ask(
            ChecklistRequest(id=fresh_id("checklist"), time_s=now_s, operator=operator(event), key=key)
        )
