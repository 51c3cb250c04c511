"""The tab that calibrates a camera: its picture with the board, views, the result, and the buttons for it."""

from collections.abc import Sequence
from datetime import UTC, datetime
from typing import Any, Final, final

import numpy as np
import viser

from app.core.dialogue.requests import CalibrationAct, CalibrationRequest
from app.core.geometry.charuco import Charuco
from app.core.messages import fresh_id
from app.ui.parts.console_state import ConsoleState
from app.ui.parts.decision import operator
from app.ui.parts.operator_controller import OperatorController
from app.ui.parts.text import Text
from app.ui.placing import cards

_NONE: Final = "none"
_MM: Final = 1e-3
_A4: Final = Charuco()
_QUALITY: Final = 80
_TAKE, _DROP = "Take a view", "Remove the last"
_CHECK, _KEEP, _END = "Check", "Keep", "End"
_ACTS: Final[dict[str, CalibrationAct]] = {_TAKE: "take", _DROP: "drop", _CHECK: "check", _KEEP: "save", _END: "end"}
_AXES_M: Final = 0.08


@final
class PlacingTab:
    """Widgets in the container that is open when this is made, and the next pose in the scene.

    Painted by the painter's thread alone; callbacks send requests to the program, in any thread.
    """

    def __init__(self, server: viser.ViserServer, controller: OperatorController) -> None:
        self._controller, self._last = controller, ConsoleState()
        gui = server.gui
        self._live = Text(gui, cards.live(self._last))
        self._camera = gui.add_dropdown("Camera", _names(()))
        self._square = gui.add_number("Square [mm]", _A4.square_m / _MM, min=5.0, max=500.0, step=0.1)
        self._marker = gui.add_number("Marker [mm]", _A4.marker_m / _MM, min=1.0, max=450.0, step=0.1)
        begin = gui.add_button("Begin", color="green", icon=viser.Icon.TARGET)
        begin.on_click(lambda event: self._ask(event, "begin"))
        self._views = gui.add_button_group("View", (_TAKE, _DROP), visible=False)
        self._ends = gui.add_button_group("Result", (_CHECK, _KEEP, _END), visible=False)
        self._views.on_click(self._on_press)
        self._ends.on_click(self._on_press)
        self._image = gui.add_image(np.zeros((2, 2, 3), np.uint8), format="jpeg", jpeg_quality=_QUALITY, visible=False)
        self._result = Text(gui, "")
        self._next = server.scene.add_frame("/calibration/next", axes_length=_AXES_M, axes_radius=0.002, visible=False)

    def paint(self, state: ConsoleState) -> None:
        """Update the tab to the state."""
        last, self._last = self._last, state
        if state.frames.keys() != last.frames.keys() and state.frames:
            self._camera.options = _names(sorted(state.frames))
            self._camera.value = self._camera.options[0]
        self._live.put(cards.live(state))
        if state.placing is not last.placing:
            self._result.put(cards.result(state.placing, datetime.now(UTC).date()))
            self._show_next(state)
        under_way = state.placing is not None and state.placing.under_way
        for widget in (self._views, self._ends, self._image):
            if widget.visible != under_way:
                widget.visible = under_way
        if under_way and state.board_seen is not last.board_seen:
            self._draw(state)

    def _draw(self, state: ConsoleState) -> None:
        seen = state.board_seen
        frame = state.frames.get(seen.camera) if seen is not None else None
        if frame is not None:
            self._image.image = cards.mark(frame.color, seen)

    def _show_next(self, state: ConsoleState) -> None:
        placing = state.placing
        shown = placing is not None and placing.under_way and len(placing.next_pose) > 0
        self._next.visible = shown
        if placing is not None and shown:
            self._next.position, self._next.wxyz = placing.next_pose[0, :3], placing.next_pose[0, 3:]

    def _on_press(self, event: viser.GuiEvent[Any]) -> None:
        if event.target.value in _ACTS:  # A page may say anything.
            self._ask(event, _ACTS[event.target.value])

    def _ask(self, event: viser.GuiEvent[Any], act: CalibrationAct) -> None:
        placing = self._last.placing
        under_way = placing is not None and placing.under_way
        camera = placing.camera if placing is not None and under_way and act != "begin" else self._camera.value
        self._controller.ask(
            CalibrationRequest(
                id=fresh_id("calibration"),
                time_s=self._controller.now(),
                operator=operator(event),
                act=act,
                camera=camera,
                square_m=float(self._square.value) * _MM,
                marker_m=float(self._marker.value) * _MM,
            )
        )


def _names(cameras: Sequence[str]) -> tuple[str, ...]:
    return tuple(cameras) or (_NONE,)
