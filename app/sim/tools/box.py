"""Boxes and their compositions: a box, a tray, walls with a gap, and the two fingers of a gripper."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

from dataclasses import dataclass
from typing import final

import warp as wp

from app.sim.constants import Shape
from app.sim.tools.base import Motion, Primitive, Quaternion, Vector, rounded_box


@wp.func
def box_surface(s: Shape, p: wp.vec3):
    """Half sides in `size`, edge radius in its last."""
    n, gap = rounded_box(p, wp.vec3(s.size[0], s.size[1], s.size[2]), s.size[3])
    return n, gap, 1.0


def box_of(
    half: Vector, place: Vector, friction: float, turn: Quaternion = (1.0, 0.0, 0.0, 0.0), *, side: int = 0
) -> Primitive:
    """A box whose edges are rounded by a fifth of its shortest side."""
    size = (*half, 0.4 * min(half))
    return Primitive(
        surface=box_surface, size=size, friction=friction, place=place, turn=turn, thin=side == 0, side=side
    )


@final
@dataclass(frozen=True, kw_only=True)
class BoxCollider:
    """A block: an obstacle where it is fixed, a paddle where it moves."""

    half_m: Vector
    place_m: Vector = (0.0, 0.0, 0.0)
    turn: Quaternion = (1.0, 0.0, 0.0, 0.0)
    friction: float = 0.3
    motion: Motion = "fixed"

    def primitives(self) -> tuple[Primitive, ...]:
        """One."""
        return (box_of(self.half_m, self.place_m, self.friction, self.turn),)


@final
@dataclass(frozen=True, kw_only=True)
class Tray:
    """A floor with a rim: its inner half sides along x and y, the height of the rim, and how thick both are."""

    half_m: tuple[float, float]
    rim_m: float
    thickness_m: float = 0.006
    place_m: Vector = (0.0, 0.0, 0.0)
    """The middle of the floor's upper side."""
    friction: float = 0.3
    motion: Motion = "fixed"

    def primitives(self) -> tuple[Primitive, ...]:
        """A floor and four sides."""
        (a, b), t = self.half_m, self.thickness_m / 2
        height = self.rim_m / 2 + t
        parts = [
            ((a + 2 * t, b + 2 * t, t), (0.0, 0.0, -t)),
            *(((t, b + 2 * t, height), (side * (a + t), 0.0, height - 2 * t)) for side in (-1, 1)),
            *(((a + 2 * t, t, height), (0.0, side * (b + t), height - 2 * t)) for side in (-1, 1)),
        ]
        return tuple(box_of(half, _shift(self.place_m, at), self.friction) for half, at in parts)


@final
@dataclass(frozen=True, kw_only=True)
class WallsWithGap:
    """A wall along y, standing on the table, with an opening `gap_m` wide in its middle."""

    place_m: Vector
    half_length_m: float
    gap_m: float
    height_m: float
    thickness_m: float = 0.01
    friction: float = 0.3
    motion: Motion = "fixed"

    def primitives(self) -> tuple[Primitive, ...]:
        """One wall on each side of the gap."""
        along, up = (self.half_length_m - self.gap_m / 2) / 2, self.height_m / 2
        middle = self.gap_m / 2 + along
        half = (self.thickness_m / 2, along, up)
        return tuple(box_of(half, _shift(self.place_m, (0.0, side * middle, up)), self.friction) for side in (-1, 1))


@final
@dataclass(frozen=True, kw_only=True)
class GripperCollider:
    """Two fingers that open along their own y axis; the tool position is the point between their tips.

    `half_m`: of one finger, across, along its thickness, and up. Between closed fingers, matter goes with them.
    """

    half_m: Vector = (0.010, 0.006, 0.020)
    friction: float = 0.8
    motion: Motion = "opens"

    def primitives(self) -> tuple[Primitive, ...]:
        """Two fingers: at opening 0 their inner sides meet."""
        _, thick, tall = self.half_m
        return tuple(box_of(self.half_m, (0.0, side * thick, tall), self.friction, side=side) for side in (-1, 1))


def _shift(place: Vector, by: Vector) -> Vector:
    return (place[0] + by[0], place[1] + by[1], place[2] + by[2])
