"""The tool: a gripper as a palm and two fingers, a flat finger as a plate, a paddle as a board, a bowl as it is."""

from typing import NamedTuple, Self, final

import numpy as np
import viser

from app.core.errors import UsageError
from app.core.geometry.shapes.base import Vector
from app.core.geometry.shapes.meshes import bowl_mesh
from app.core.geometry.shapes.tools import Tool
from app.core.geometry.track import upright
from app.core.task_name import TaskName
from app.ui.parts.palette import Colour
from app.ui.view.fixtures import SEEN_THROUGH

_FINGER_M = (0.014, 0.014, 0.11)
_OPENING_M = 0.085
_WALL_M = 0.003
"""Wall of a drawn bowl, of which the outer radius is to scale."""
_POSE = 7
"""Numbers of a pose: a place, and a quaternion."""


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
class DrawnTool:
    """A drawn tool, made at the first `put`: `tool`, or two fingers, of which only the tip's position is to scale.

    A flat finger, which is told by a task's name, has the width and the yaw of that name.
    """

    def __init__(
        self,
        server: viser.ViserServer,
        name: str,
        colour: Colour,
        *,
        opacity: float | None,
        tool: Tool | None = None,
    ) -> None:
        self._tool = tool
        self._finger_m, self._opening_m, self._across = _FINGER_M, _OPENING_M, 0
        if tool is not None and (fingers := tool.fingers) is not None:
            x, y, z = fingers.half_m
            self._finger_m, self._opening_m, self._across = (2 * x, 2 * y, 2 * z), fingers.opening_m, 1
        self._flat: Flat | None = None
        self._scene = server.scene
        self._name = name
        self._colour = colour
        self._opacity = opacity
        self._frame: viser.FrameHandle | None = None
        self._fingers: list[viser.BoxHandle] = []

    def put(self, pose: np.ndarray, closed: float) -> None:
        """Show it at a pose: its tip [m], and its quaternion w x y z where it is known, or upright.

        `closed` is 0 for open and 1 for closed.
        """
        if not np.isfinite(pose[:3]).all():
            return
        frame = self._frame or self._build()
        frame.position = pose[:3]
        if len(pose) >= _POSE and np.isfinite(pose).all() and self._flat is None:
            frame.wxyz = upright(pose[None, 3:_POSE].astype(np.float64))[0]
        frame.visible = True
        apart_m = self._finger_m[self._across] + self._opening_m * (1 - float(np.clip(closed, 0, 1)))
        for side, finger in zip((-1, 1), self._fingers, strict=False):
            place = np.array([0.0, 0.0, self._finger_m[2] / 2])
            place[self._across] = side * apart_m / 2
            finger.position = place

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
        middle = (0.0, 0.0, self._finger_m[2] / 2)
        bowl_m, board_m = (self._tool.bowl_m, self._tool.board_m) if self._tool else (None, None)
        if bowl_m is not None:
            wall = bowl_mesh(bowl_m - _WALL_M, _WALL_M)
            self._scene.add_mesh_simple(
                *(f"{self._name}/bowl", wall.vertices, wall.faces),
                color=self._colour,
                opacity=SEEN_THROUGH,
                side="double",
                cast_shadow=False,
            )
        elif board_m is not None:
            x, y, z = board_m
            self._box("board", (2 * x, 2 * y, 2 * z), (0.0, 0.0, 0.0))
        elif self._flat is not None:
            thick_m = 2 * self._flat.radius_m
            self._box("finger_flat", (2 * self._flat.half_width_m + thick_m, thick_m, _FINGER_M[2]), middle)
        else:
            self._fingers = [self._box(f"finger_{side}", self._finger_m, middle) for side in ("left", "right")]
        self._box("palm", (0.10, 0.05, 0.05), (0.0, 0.0, self._finger_m[2] + 0.025))
        return self._frame

    def _box(self, part: str, sides_m: Vector, middle_m: Vector) -> viser.BoxHandle:
        return self._scene.add_box(
            f"{self._name}/{part}",
            color=self._colour,
            dimensions=sides_m,
            opacity=self._opacity,
            cast_shadow=self._opacity is None,
            position=middle_m,
        )
