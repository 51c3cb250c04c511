"""The buttons that begin and end an experiment: pushes chosen to be informative about the model."""

from typing import Any, Final, final

import viser

from app.core.dialogue.requests import ProbeRequest
from app.core.messages import fresh_id
from app.ui.parts.decision import operator
from app.ui.parts.operator_controller import OperatorController

_FIRST, _MOST = 24, 400
"""Pushes."""
BEGIN: Final = "Find out what the model lacks"
END: Final = "Plan for the goal again"


@final
class ProbeForm:
    """The buttons in the container that is open when this is made. Each push is shown and decided on like any other."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController) -> None:
        self._controller = controller
        pushes = gui.add_number("Pushes at most", _FIRST, min=1, max=_MOST, step=1)
        begin = gui.add_button(BEGIN, color="gray", icon=viser.Icon.MICROSCOPE)
        begin.on_click(lambda event: self._ask(event, int(pushes.value)))
        end = gui.add_button(END, color="gray", icon=viser.Icon.TARGET)
        end.on_click(lambda event: self._ask(event, 0))

    def _ask(self, event: viser.GuiEvent[Any], pushes: int) -> None:
        now_s = self._controller.now()
        self._controller.ask(ProbeRequest(id=fresh_id("probe"), time_s=now_s, operator=operator(event), pushes=pushes))
