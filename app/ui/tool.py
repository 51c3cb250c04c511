"""The gripper as a palm and two fingers, tip down at the tool's position."""

from typing import final

import numpy as np
import viser

from app.ui.palette import Colour

_FINGER_M = (0.014, 0.014, 0.11)
_OPENING_M = 0.085


@final
class Tool:
    """A drawn gripper, made at the first `put`. It stands upright: only the tip's position is drawn to measure."""

    def __init__(self, server: viser.ViserServer, name: str, colour: Colour, *, opacity: float | None) -> None:
        self._scene = server.scene
        self._name = name
        self._colour = colour
        self._opacity = opacity
        self._frame: viser.FrameHandle | None = None
        self._fingers: list[viser.BoxHandle] = []

    def put(self, tip: np.ndarray, closed: float) -> None:
        """Show it with its tip at `tip [m] (3,)`; `closed` is 0 for open and 1 for closed."""
        if not np.isfinite(tip).all():
            return
        frame = self._frame or self._build()
        frame.position = tip
        frame.visible = True
        half_m = 0.5 * (_FINGER_M[0] + _OPENING_M * (1 - float(np.clip(closed, 0, 1))))
        for side, finger in zip((-1, 1), self._fingers, strict=True):
            finger.position = (side * half_m, 0.0, _FINGER_M[2] / 2)

    def hide(self) -> None:
        """Draw it no more until the next `put`."""
        if self._frame is not None and self._frame.visible:
            self._frame.visible = False

    def _build(self) -> viser.FrameHandle:
        self._frame = self._scene.add_frame(self._name, show_axes=False)
        shadow = self._opacity is None
        self._fingers = [
            self._scene.add_box(
                f"{self._name}/finger_{side}",
                color=self._colour,
                dimensions=_FINGER_M,
                opacity=self._opacity,
                cast_shadow=shadow,
            )
            for side in ("left", "right")
        ]
        self._scene.add_box(
            f"{self._name}/palm",
            color=self._colour,
            dimensions=(0.10, 0.05, 0.05),
            opacity=self._opacity,
            cast_shadow=shadow,
            position=(0.0, 0.0, _FINGER_M[2] + 0.025),
        )
        return self._frame
