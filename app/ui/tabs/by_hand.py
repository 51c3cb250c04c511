"""Buttons to take over by hand in mid-motion and to give back, and that for the way to the start pose."""

from typing import Any, Final, final

import viser

from app.core.dialogue.requests import HandRequest, StartPoseRequest
from app.core.messages import fresh_id
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.decision import operator
from app.ui.parts.operator_controller import OperatorController

TAKE: Final = "Take over by hand"
GIVE: Final = "Give back"
START: Final = "Go to the start pose"


@final
class HandForm:
    """The buttons in the container that is open when this is made. Painted by the painter's thread alone."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController) -> None:
        self._controller = controller
        self._take = gui.add_button(
            TAKE, color="orange", icon=viser.Icon.HAND_GRAB, hint="Brakes the arm; then it heeds the hand"
        )
        self._take.on_click(lambda event: controller.take_over(operator(event)))
        self._give = gui.add_button(GIVE, color="green", icon=viser.Icon.ARROW_BACK_UP, visible=False)
        self._give.on_click(self._give_back)
        self._start = gui.add_button(
            START, color="gray", icon=viser.Icon.HOME, hint="Offered as a plan; it moves once you approve it"
        )
        self._start.on_click(self._go_to_start)

    def paint(self, state: ConsoleState) -> None:
        """Show the buttons that apply in this mode."""
        by_hand = state.is_teleoperated
        if self._give.visible != by_hand:
            self._give.visible, self._take.visible = by_hand, not by_hand

    def _give_back(self, event: viser.GuiEvent[Any]) -> None:
        now_s = self._controller.now()
        self._controller.ask(HandRequest(id=fresh_id("hand"), time_s=now_s, operator=operator(event), act="give"))

    def _go_to_start(self, event: viser.GuiEvent[Any]) -> None:
        now_s = self._controller.now()
        self._controller.ask(StartPoseRequest(id=fresh_id("start"), time_s=now_s, operator=operator(event)))
