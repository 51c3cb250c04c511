"""The buttons that choose what the program does by itself, and that end it."""

from typing import Any, Final, final

import viser

from app.core.control import EndRequest, ModeName, ModeRequest
from app.core.messages import fresh_id
from app.ui import words
from app.ui.decision import operator
from app.ui.desk import Desk

_PRESSED: Final[dict[str, ModeName]] = {words.MODES[mode]: mode for mode in words.MODES if mode != "automatic"}
_SURE: Final = "Yes: on the REAL arm, without approval"
_FIRST, _MOST = 3, 100
"""Motions."""


@final
class ModeForm:
    """The buttons in the container that is open when this is made."""

    def __init__(self, gui: viser.GuiApi, desk: Desk) -> None:
        self._desk = desk
        buttons = gui.add_button_group("Mode", tuple(_PRESSED))

        def pressed(event: viser.GuiEvent[Any]) -> None:
            if event.target.value in _PRESSED:  # A page may say anything.
                self._ask(event, _PRESSED[event.target.value])

        buttons.on_click(pressed)
        with gui.add_form(None) as form:
            motions = gui.add_number("Motions", _FIRST, min=1, max=_MOST, step=1)
            start = gui.add_button("Make them automatically", color="gray", icon=viser.Icon.PLAYER_TRACK_NEXT)
        sure = gui.add_button(_SURE, color="red", icon=viser.Icon.ALERT_TRIANGLE, visible=False)

        def automatic(event: viser.GuiEvent[Any]) -> None:
            if self._real:
                sure.visible = True
            else:
                self._ask(event, "automatic", int(motions.value))

        def confirmed(event: viser.GuiEvent[Any]) -> None:
            if sure.visible:
                sure.visible = False
                self._ask(event, "automatic", int(motions.value), confirmed=True)

        def other_number(_: viser.GuiEvent[Any]) -> None:
            sure.visible = False

        start.on_click(automatic)
        form.on_submit(automatic)
        sure.on_click(confirmed)
        motions.on_update(other_number)

    @property
    def _real(self) -> bool:
        """Whether something real moves."""
        episode = self._desk.board.episode
        return episode is None or not episode.simulated

    def _ask(self, event: viser.GuiEvent[Any], mode: ModeName, motions: int = 0, *, confirmed: bool = False) -> None:
        self._desk.ask(
            ModeRequest(
                id=fresh_id("mode"),
                time_s=self._desk.now(),
                operator=operator(event),
                mode=mode,
                motions=motions,
                confirmed=confirmed,
            )
        )


@final
class EndButton:
    """Ends the session, once it is said twice."""

    def __init__(self, gui: viser.GuiApi, desk: Desk) -> None:
        sure = gui.add_checkbox("End the session", initial_value=False, hint="Closes the recording and the program")
        end = gui.add_button("End it now", color="red", icon=viser.Icon.POWER, visible=False)

        def ask(event: viser.GuiEvent[Any]) -> None:
            desk.ask(EndRequest(id=fresh_id("end"), time_s=desk.now(), operator=operator(event)))

        def reveal(event: viser.GuiEvent[Any]) -> None:
            end.visible = bool(event.target.value)

        sure.on_update(reveal)
        end.on_click(ask)
