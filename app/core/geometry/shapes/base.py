"""Geometry that every tool and every fixture gives of itself.

A class of `tools.py` or `fixtures.py` is all that perception, goals and the arm's shape need of a new kind. A simulated
world or a picture that makes something of its own of it, in `app/rig/simulated`, asks for its type.
"""

from typing import TYPE_CHECKING, ClassVar, NamedTuple, Protocol, TypeAlias

import numpy as np
from jaxtyping import Bool

from app.core.geometry.shapes.hulls import Corners
from app.core.geometry.shapes.outlines import Outline
from app.core.types import Cloud, ToolPose

if TYPE_CHECKING:
    from app.core.geometry.shapes.meshes import TriangleMesh

Colour: TypeAlias = tuple[float, float, float]
"""RGB albedo in 0..1."""
Vector: TypeAlias = tuple[float, float, float]


class GripperFingers(NamedTuple):
    """Two upright fingers: half sides [m] of each, largest opening [m], and that below which they hold [m]."""

    half_m: Vector
    opening_m: float
    closed_m: float


class ToolGeometry(Protocol):
    """Geometry of a kind of tool at its pose in the world."""

    has_shank: ClassVar[bool]
    """True for a tool that a closed gripper holds by a shank, out of the object's way; False for one whose holder is
    near the object, which must stay visible, or is the tool."""

    def hulls(self, at: ToolPose, margin_m: float) -> list[Corners]:
        """Convex parts that cameras take for the object, larger by the margin on every side.

        Parts that hold the object have no margin, and a part in which it lies is left out: the object stays visible.
        """
        ...

    @property
    def ball_m(self) -> float | None:
        """Radius of a round tip by which cameras find the tool [m]; None without one."""
        return None

    @property
    def board_m(self) -> Vector | None:
        """Half sides of a board about its place by which cameras find the tool [m]; None without one."""
        return None

    @property
    def fingers(self) -> GripperFingers | None:
        """Fingers that hold an object between them; None of a tool without."""
        return None

    @property
    def bowl_m(self) -> float | None:
        """Outer radius of half a sphere about its place by which cameras find the tool [m]; None without one."""
        return None

    def outline(self, at: ToolPose) -> Outline | None:
        """Outline by which the tool pushes an object that lies on the table; None for a tool that holds the object."""
        ...


class FixtureGeometry(Protocol):
    """Geometry of a kind of fixture, which stands where it is. `is_hollow`: the object may be in it."""

    is_hollow: ClassVar[bool] = False

    def contains(self, points: Cloud, margin_m: float) -> Bool[np.ndarray, " M"]:
        """Mask of the points (M, 3) [m] that lie deeper than `margin_m` inside the solid."""
        ...

    def mesh(self) -> "TriangleMesh":
        """Its surface in the world, for pictures."""
        ...
