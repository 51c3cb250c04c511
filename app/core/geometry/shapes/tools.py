"""Tools of an arm, each with its geometry. A kind of tool is a class here, and a member of `Tool`."""

from dataclasses import dataclass
from math import cos, sin
from typing import ClassVar, TypeAlias, final

import numpy as np
from jaxtyping import Float64
from scipy.spatial.transform import Rotation

from app.core.geometry.shapes.base import Colour, GripperFingers, ToolGeometry, Vector
from app.core.geometry.shapes.hulls import Corners, box_corners, capsule_corners, strip_corners
from app.core.geometry.shapes.outlines import Rectangle, Stadium
from app.core.types import ToolPose

HAND_DISTANCE_M, HANDLE_RADIUS_M = 0.10, 0.008
"""Distance from the tip of a tool to the hand, and radius of a paddle's handle."""


@final
@dataclass(frozen=True, kw_only=True)
class Finger(ToolGeometry):
    """The closed two-finger gripper, which points down: every point within `radius_m` of its core.

    The core is an upright strip on a level line through the tool, `half_width_m` to either side of it, at `yaw_rad`
    from the world's x axis. Without width the finger is a capsule. `push_height_m`: its tip's height above the table.
    """

    has_shank: ClassVar[bool] = True

    radius_m: float
    push_height_m: float
    half_width_m: float = 0.0
    yaw_rad: float = 0.0

    @property
    def half_m(self) -> tuple[float, float]:
        """Vector from the tool to an end of that line [m], seen from above."""
        if self.half_width_m == 0:
            return 0.0, 0.0
        return self.half_width_m * cos(self.yaw_rad), self.half_width_m * sin(self.yaw_rad)

    def ends_m(self) -> list[Vector]:
        """Vectors from the tool to the ends of that line [m], in the world; zero for a finger without width."""
        x, y = self.half_m
        return [(-x, -y, 0.0), (x, y, 0.0)] if self.half_width_m > 0 else [(0.0, 0.0, 0.0)]

    @property
    def ball_m(self) -> float | None:
        """Its radius; a flat finger looks alike wherever along its width it is."""
        return self.radius_m if self.half_width_m == 0 else None

    def hulls(self, at: ToolPose, margin_m: float) -> list[Corners]:
        """The strip up to the hand."""
        tip, up = at[:3], -_turn(at)[:, 2]
        sides = [tip + np.asarray(side) for side in self.ends_m()]
        begin, end = ([side + height * up for side in sides] for height in (self.radius_m, HAND_DISTANCE_M))
        return strip_corners(begin, end, self.radius_m + margin_m)

    def outline(self, at: ToolPose) -> Stadium:
        """The line with its radius; its yaw is the world's, however the tool is turned."""
        return Stadium(
            half_m=self.half_m, half_width_m=self.half_width_m, radius_m=self.radius_m, bottom_m=float(at[2])
        )


@final
@dataclass(frozen=True, kw_only=True)
class Paddle(ToolGeometry):
    """A flat upright board, whose middle is the tool's position; `sweep_height_m` is that of its middle in a sweep.

    Half sides [m] across, along its thickness, and up: along x, y and z where the tool, pointing down, is not turned.
    """

    has_shank: ClassVar[bool] = True

    half_m: Vector
    sweep_height_m: float

    @property
    def board_m(self) -> Vector:
        """Itself."""
        return self.half_m

    def hulls(self, at: ToolPose, margin_m: float) -> list[Corners]:
        """The board, and its handle up to the hand."""
        turn, middle = _turn(at), at[:3]
        up = -turn[:, 2]
        handle = middle + self.half_m[2] * up, middle + HAND_DISTANCE_M * up
        return [
            box_corners(self.half_m, turn, middle, margin_m),
            *capsule_corners(*handle, HANDLE_RADIUS_M + margin_m),
        ]

    def outline(self, at: ToolPose) -> Rectangle:
        """The board from above, turned with the tool."""
        across, thick, up = self.half_m
        return Rectangle(axes=_turn(at)[:2, :2].T, half_m=(across, thick), bottom_m=float(at[2] - up))


@final
@dataclass(frozen=True, kw_only=True)
class Gripper(ToolGeometry):
    """Two upright fingers, boxes of the half sides `half_m`, that open along y; the tool is the point between the tips.

    They open up to `opening_m`, and hold an object between them where they are `closed_m` apart or less.
    """

    has_shank: ClassVar[bool] = False

    half_m: Vector
    opening_m: float
    closed_m: float

    def hulls(self, at: ToolPose, margin_m: float) -> list[Corners]:
        """Both fingers as far apart as they are, without margin: the object is between them."""
        del margin_m
        turn, aside = _turn(at), at[7] / 2 + self.half_m[1]
        return [
            box_corners(self.half_m, turn, at[:3] + turn @ np.array([0.0, side * aside, -self.half_m[2]]), 0.0)
            for side in (-1, 1)
        ]

    @property
    def fingers(self) -> GripperFingers:
        """Both of them."""
        return GripperFingers(half_m=self.half_m, opening_m=self.opening_m, closed_m=self.closed_m)

    def outline(self, at: ToolPose) -> None:
        """None: it holds."""


@final
@dataclass(frozen=True, kw_only=True)
class HeldBowl(ToolGeometry):
    """Half of a hollow sphere in the hand, with its centre at the tool's position; upright where the tool points down.

    `radius_m`: the inner one.
    """

    has_shank: ClassVar[bool] = False

    radius_m: float
    thickness_m: float
    friction: float = 0.1
    colour: Colour = (0.85, 0.84, 0.80)

    @property
    def bowl_m(self) -> float:
        """That of its outer wall."""
        return self.radius_m + self.thickness_m

    def hulls(self, at: ToolPose, margin_m: float) -> list[Corners]:
        """None: the object lies in it."""
        del at, margin_m
        return []

    def outline(self, at: ToolPose) -> None:
        """None: it holds."""


Tool: TypeAlias = Finger | Paddle | Gripper | HeldBowl


def _turn(at: ToolPose) -> Float64[np.ndarray, "3 3"]:
    """Rotation of the tool's own axes to the world's."""
    return Rotation.from_quat(at[3:7], scalar_first=True).as_matrix()
