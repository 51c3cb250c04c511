"""The gripper as a palm and two fingers, tip down at the tool's position; a flat finger as a plate."""

from typing import NamedTuple, Self, final

import numpy as np
import viser

from app.core.errors import UsageError
from app.core.task_name import TaskName
from app.ui.parts.palette import Colour

_FINGER_M = (0.014, 0.014, 0.11)
_OPENING_M = 0.085


class Flat(NamedTuple):
    """Sizes of a flat finger, from a task's name."""

    radius_m: float
    half_width_m: float
    yaw_rad: float

    @classmethod
    def of(cls, task: str) -> Self | None:
        """Finger of the task of this name; None where its tool is not flat, or not a finger."""
        try:
            sizes = dict(TaskName.parse(task).sizes)
        except UsageError:  # A recording of another program.
            return None
        half_width_m = sizes.get("finger_half_width_m", 0.0)
        if half_width_m == 0:
            return None
        return cls(sizes.get("finger_radius_m", _FINGER_M[1] / 2), half_width_m, sizes.get("finger_yaw_rad", 0.0))


@final
class DrawnGripper:
    """A drawn gripper, made at the first `put`.

    It stands upright: only the tip's position is to scale, and of a flat finger also width and yaw.
    """

    def __init__(self, server: viser.ViserServer, name: str, colour: Colour, *, opacity: float | None) -> None:
        self._flat: Flat | None = None
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
        if self._flat is not None:
            return
        half_m = 0.5 * (_FINGER_M[0] + _OPENING_M * (1 - float(np.clip(closed, 0, 1))))
        for side, finger in zip((-1, 1), self._fingers, strict=True):
            finger.position = (side * half_m, 0.0, _FINGER_M[2] / 2)

    def become(self, flat: Flat | None) -> None:
        """Draw it as this flat finger from the next `put` on, or as two fingers."""
        if flat != self._flat:
            self._flat, self._fingers = flat, []
            if self._frame is not None:
                self._frame.remove()
                self._frame = None

    def hide(self) -> None:
        """Hide it until the next `put`."""
        if self._frame is not None and self._frame.visible:
            self._frame.visible = False

    def _build(self) -> viser.FrameHandle:
        turn = self._flat.yaw_rad if self._flat else 0.0
        self._frame = self._scene.add_frame(
            self._name, show_axes=False, wxyz=(np.cos(turn / 2), 0.0, 0.0, np.sin(turn / 2))
        )
        shadow = self._opacity is None
        sides, size = ("left", "right"), _FINGER_M
        if self._flat is not None:
            radius_m = self._flat.radius_m
            sides, size = ("flat",), (2 * (self._flat.half_width_m + radius_m), 2 * radius_m, _FINGER_M[2])
        self._fingers = [
            self._scene.add_box(
                f"{self._name}/finger_{side}",
                color=self._colour,
                dimensions=size,
                opacity=self._opacity,
                cast_shadow=shadow,
                position=(0.0, 0.0, size[2] / 2),
            )
            for side in sides
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
