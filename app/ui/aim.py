"""The handle with arrows in the scene: the target of the tool while "Go there" is held."""

from typing import Final, final

import numpy as np
import viser

from app.config import Workspace
from app.ui.jog_socket import JogHandler
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.operator_controller import OperatorController
from app.ui.server.message_validation import AIM

_SCALE_M: Final = 0.09


@final
class TargetHandle:
    """Handle shown in teleoperation alone, at first at the tool. An operator who may move the tool may drag it.

    Painted by the painter's thread; dragged by viser's.
    """

    def __init__(
        self, server: viser.ViserServer, workspace: Workspace, controller: OperatorController, hand: JogHandler
    ) -> None:
        self._workspace, self._controller, self._hand = workspace, controller, hand
        self._at = (np.array(workspace.low) + np.array(workspace.high)) / 2
        low, high = workspace.low, workspace.high
        self._handle = server.scene.add_transform_controls(
            AIM,
            scale=_SCALE_M,
            disable_rotations=True,
            translation_limits=((low[0], high[0]), (low[1], high[1]), (low[2], high[2])),
            position=self._at,
            visible=False,
        )
        self._handle.on_update(self._on_drag)

    def paint(self, state: ConsoleState) -> None:
        """Show or hide it; put it back where an operator dragged it without permission."""
        shown = state.is_teleoperated
        if shown and not self._handle.visible and state.arm is not None:
            self._set_position(state.arm.pose[:3])
        if shown != self._handle.visible:
            self._handle.visible = shown
        if not np.allclose(self._handle.position, self._at):
            self._handle.position = self._at

    async def _on_drag(self, event: viser.TransformControlsEvent) -> None:
        if self._controller.blocked_reason(f"client {event.client_id}") is None:
            self._set_position(np.asarray(event.target.position, np.float64))

    def _set_position(self, position: np.ndarray) -> None:
        """Clip and set the position: viser's page keeps to the limits; another client may not."""
        if np.isfinite(position).all():
            self._at = np.clip(position, self._workspace.low, self._workspace.high)
            self._hand.aim(self._at)
