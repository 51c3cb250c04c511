"""The buttons that begin and end demonstrations, and that keep the recent recording as a clip."""

from pathlib import Path
from typing import Any, Final, final

import viser

from app.core.dialogue import words
from app.core.dialogue.requests import ClipRequest, DemonstrationRequest, TakeAct, TakeRequest
from app.core.messages import fresh_id
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.decision import operator
from app.ui.parts.operator_controller import OperatorController

_WANTED: Final = 10
"""Demonstrations that a calibration needs (paper, section V)."""
_CLIP_S: Final = 30.0
AGAIN: Final = "Make it again on the arm"
_SUCCESS, _FAILURE, _REDO, _DISCARD = "Success", "Failure", "Redo", "Discard"
_ACTS: Final[dict[str, TakeAct]] = {_SUCCESS: "success", _FAILURE: "failure", _REDO: "redo", _DISCARD: "discard"}


def card(state: ConsoleState) -> str:
    """Card of the demonstration being recorded, and of the number so far."""
    take = state.take
    if take is None:
        said = "None yet."
    elif take.state == "recording":
        said = f"<b class='dp-bad'>Recording number {take.number}</b>, {words.motions(take.transitions)} so far."
    else:
        said = f"Number {take.number}: {take.state}."
    succeeded = take.succeeded if take else 0
    return f"<div class='dp'>{said} <small>{succeeded} of {_WANTED} succeeded.</small></div>"


@final
class DemonstrationForm:
    """The buttons in the container that is open when this is made. Painted by the painter's thread alone."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController) -> None:
        self._controller = controller
        self._said = gui.add_html(card(controller.state))
        self._start = gui.add_button("Start a demonstration", color="red", icon=viser.Icon.PLAYER_RECORD)
        self._start.on_click(lambda event: self._ask(event, "start"))
        self._end = gui.add_button_group("End as", tuple(_ACTS), visible=False)
        self._end.on_click(self._on_press)
        self._newest = 0
        self._which = gui.add_text("File to make again", "", hint="A demonstration's file in the session's folder")
        again = gui.add_button(AGAIN, color="gray", icon=viser.Icon.REPEAT)
        again.on_click(self._make_again)
        clip = gui.add_button(f"Save the last {_CLIP_S:.0f} seconds", color="gray", icon=viser.Icon.HISTORY)
        clip.on_click(self._keep)

    def paint(self, state: ConsoleState) -> None:
        """Show the buttons that apply now."""
        content = card(state)
        if content != self._said.content:
            self._said.content = content
        take = state.take
        if take is not None and take.state == "success" and take.number != self._newest:
            self._newest, self._which.value = take.number, Path(take.path).name
        if self._end.visible != state.demonstrating:
            self._end.visible = state.demonstrating
            self._start.visible = not state.demonstrating

    def _on_press(self, event: viser.GuiEvent[Any]) -> None:
        if event.target.value in _ACTS:  # A page may say anything.
            self._ask(event, _ACTS[event.target.value])

    def _ask(self, event: viser.GuiEvent[Any], act: TakeAct) -> None:
        now_s = self._controller.now()
        self._controller.ask(TakeRequest(id=fresh_id("take"), time_s=now_s, operator=operator(event), act=act))

    def _make_again(self, event: viser.GuiEvent[Any]) -> None:
        now_s, name = self._controller.now(), str(self._which.value).strip()
        if not name:
            self._controller.tell("Name the file of a demonstration; end one as a success, and its name stands there.")
            return
        self._controller.ask(
            DemonstrationRequest(id=fresh_id("again"), time_s=now_s, operator=operator(event), recording=name)
        )

    def _keep(self, event: viser.GuiEvent[Any]) -> None:
        now_s = self._controller.now()
        self._controller.ask(
            ClipRequest(id=fresh_id("clip"), time_s=now_s, operator=operator(event), duration_s=_CLIP_S)
        )
