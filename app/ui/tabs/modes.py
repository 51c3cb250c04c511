"""The buttons that choose the mode of operation, and that end the session."""

from typing import Any, Final, final

import viser

from app.core.dialogue import words
from app.core.dialogue.control import EndRequest, ModeName, ModeRequest
from app.core.messages import fresh_id
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.decision import operator
from app.ui.parts.operator_controller import OperatorController

_PRESSED: Final[dict[str, ModeName]] = {words.MODES[mode]: mode for mode in words.MODES if mode != "automatic"}
_FIRST, _MOST = 3, 100
"""Motions."""


@final
class ModeForm:
    """The buttons in the container that is open when this is made."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController) -> None:
        self._controller = controller
        buttons = gui.add_button_group("Mode", tuple(_PRESSED))

        def pressed(event: viser.GuiEvent[Any]) -> None:
            if event.target.value in _PRESSED:  # A page may say anything.
                self._ask(event, _PRESSED[event.target.value])

        buttons.on_click(pressed)
        # In a form the page would lose input within 50 ms of a press, and Enter would move the arm.
        motions = gui.add_number("Motions", _FIRST, min=1, max=_MOST, step=1)
        start = gui.add_button(_automatically(_FIRST), color="gray", icon=viser.Icon.PLAYER_TRACK_NEXT)
        self._sure = gui.add_button("", color="red", icon=viser.Icon.ALERT_TRIANGLE, visible=False)
        self._asked: tuple[str, int] | None = None

        def counted(_: viser.GuiEvent[Any]) -> None:
            start.label = _automatically(int(motions.value))

        def automatic(event: viser.GuiEvent[Any]) -> None:
            if self._real:
                self._make_sure(operator(event), int(motions.value))
            else:
                self._ask(event, "automatic", int(motions.value))

        motions.on_update(counted)
        start.on_click(automatic)
        self._sure.on_click(self._on_confirm)

    def paint(self, state: ConsoleState) -> None:
        """Withdraw the confirmation of an operator who has lost control."""
        if self._asked is not None and self._asked[0] != state.holder:
            self._asked = None
        if self._sure.visible != (self._asked is not None):
            self._sure.visible = self._asked is not None

    def _make_sure(self, who: str, motions: int) -> None:
        """Ask the operator in control for confirmation, with the number that counts: all browsers share the field."""
        if self._controller.state.holder != who:
            self._controller.tell(f"{who} has no control; take it first.")
            return
        self._asked = who, motions
        self._sure.label = f"Yes: {words.motions(motions)} on the REAL arm, without approval"
        self._sure.visible = True

    def _on_confirm(self, event: viser.GuiEvent[Any]) -> None:
        asked = self._asked
        if asked is not None and asked[0] == operator(event):
            self._asked = None
            self._ask(event, "automatic", asked[1], confirmed=True)

    @property
    def _real(self) -> bool:
        """True where something real moves."""
        episode = self._controller.state.episode
        return episode is None or not episode.simulated

    def _ask(self, event: viser.GuiEvent[Any], mode: ModeName, motions: int = 0, *, confirmed: bool = False) -> None:
        self._controller.ask(
            ModeRequest(
                id=fresh_id("mode"),
                time_s=self._controller.now(),
                operator=operator(event),
                mode=mode,
                motions=motions,
                confirmed=confirmed,
            )
        )


def _automatically(motions: int) -> str:
    """Label with the number received here: the page drops input less than 50 ms before a press."""
    return f"Make {words.motions(motions)} automatically"


@final
class EndButton:
    """Button that ends the session, after confirmation."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController) -> None:
        sure = gui.add_checkbox("End the session", initial_value=False, hint="Closes the recording and the program")
        end = gui.add_button("End it now", color="red", icon=viser.Icon.POWER, visible=False)

        def ask(event: viser.GuiEvent[Any]) -> None:
            controller.ask(EndRequest(id=fresh_id("end"), time_s=controller.now(), operator=operator(event)))

        def reveal(event: viser.GuiEvent[Any]) -> None:
            end.visible = bool(event.target.value)

        sure.on_update(reveal)
        end.on_click(ask)
