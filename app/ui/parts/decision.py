"""Approve, Reject and Resume, and the permission to press them.

Every proposal gets buttons of its own, made when it appears and removed when it is gone. A press is therefore a
decision on the plan that was on that browser's screen, however late it arrives: removed buttons have no effect.
"""

from typing import Any, final

import viser

from app.core.messages import Proposal
from app.ui.parts import cards
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.operator_controller import OperatorController

_TAKE, _GIVE = "Take", "Release"
_ARMING_S = 0.5
"""Delay before new buttons take presses: a click may have been meant for the previous plan's."""


@final
class DecisionForm:
    """The buttons in the container that is open when this is made. Painted by the painter's thread alone."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController) -> None:
        self._gui = gui
        self._controller = controller
        self._resume = gui.add_button("Resume", color="orange", icon=viser.Icon.PLAYER_PLAY, visible=False)
        self._resume.on_click(lambda event: controller.resume(operator(event)))
        self._control = ControlForm(gui, controller)
        self._place = gui.add_folder(None, visible=not controller.state.replay)
        self._shown_s = 0.0
        self._build(None)

    def paint(self, state: ConsoleState, now_s: float) -> None:
        """Update the buttons to the decisions that are possible now."""
        if self._resume.visible != (resumable := state.is_stopped and not state.replay):
            self._resume.visible = resumable
        self._control.paint(state)
        if state.pending is not self._proposal:
            for widget in (self._mark, self._approve, self._form):
                widget.remove()
            self._shown_s = now_s
            self._build(state.pending)
        disabled = not state.decidable or now_s < self._shown_s + _ARMING_S
        for widget in (self._approve, self._reject, self._reason):
            if widget.disabled != disabled:
                widget.disabled = disabled

    def _build(self, proposal: Proposal | None) -> None:
        self._proposal = proposal
        with self._place:
            self._mark = self._gui.add_html('<i class="dp-next-is-large"></i>')
            self._approve = self._gui.add_button(
                "Approve this motion", color="green", icon=viser.Icon.CHECK, disabled=True
            )
            self._form = self._gui.add_form(None)
            with self._form:
                self._reason = self._gui.add_text(
                    "Reason", "", disabled=True, hint="Goes into the log with a rejection"
                )
                self._reject = self._gui.add_button(
                    "Reject and plan again", color="gray", icon=viser.Icon.X, disabled=True
                )
        if proposal is None:
            return
        reason = self._reason
        self._approve.on_click(lambda event: self._decide(proposal, event, approve=True, reason=""))
        for pressed in (self._reject.on_click, self._form.on_submit):
            pressed(lambda event: self._decide(proposal, event, approve=False, reason=reason.value))

    def _decide(self, proposal: Proposal, event: viser.GuiEvent[Any], *, approve: bool, reason: str) -> None:
        self._controller.decide(proposal, approve=approve, operator=operator(event), reason=reason)


@final
class ControlForm:
    """The operator in control, and the buttons to take and release it. They never move the buttons below them."""

    def __init__(self, gui: viser.GuiApi, controller: OperatorController) -> None:
        self._held = gui.add_html(cards.control(controller.state))
        buttons = gui.add_button_group("Control", (_TAKE, _GIVE), visible=not controller.state.replay)

        def pressed(event: viser.GuiEvent[Any]) -> None:
            act = controller.take if event.target.value == _TAKE else controller.release
            act(operator(event))

        buttons.on_click(pressed)

    def paint(self, state: ConsoleState) -> None:
        """Show the operator in control."""
        content = cards.control(state)
        if content != self._held.content:
            self._held.content = content


def operator(event: viser.GuiEvent[Any]) -> str:
    """Name of an operator in decisions: the browser's number within this run."""
    return f"client {event.client_id}"
