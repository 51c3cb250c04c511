"""Interface of tools: primitives, each an analytic signed distance with its own friction, and their motion."""

# Warp reads its types at run time; as static types, its vectors, arrays and structs have no operators.
# pyright: reportGeneralTypeIssues=false, reportIndexIssue=false, reportOperatorIssue=false, reportArgumentType=false
# pyright: reportCallIssue=false

from dataclasses import dataclass
from typing import Literal, Protocol, TypeAlias, final

import warp as wp

from app.sim.effects.base import WarpFunction

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]
Motion: TypeAlias = Literal["fixed", "slides", "turns", "opens"]
"""Motion of a primitive, in coordinates of the tool path: none; x y z [m]; x y z and a unit quaternion w x y z;
or these and an opening [m], by half of which it moves along its own +y (side 1) or -y (side -1)."""

COORDINATES: dict[Motion, int] = {"fixed": 0, "slides": 3, "turns": 7, "opens": 8}

AXIS = wp.constant(1.0e-6)
"""Distances from an axis or a centre are at least this [m]: there, there is no normal, and shall be no NaN."""


@final
@dataclass(frozen=True, kw_only=True)
class Primitive:
    """One convex or hollow thing.

    `surface(s, p) -> n, gap, cover`, a Warp function: for a point p [m] in the primitive's frame and its numbers
    `constants.Shape`, the outward normal, the signed distance [m], and how much of the contact there is (0..1).
    `place` and `turn` say where it is in its tool's frame, or in the world where it is fixed. `thin`: nothing is let
    through, particle by particle, however thin it is. `side`: of what it opens to. `grasps`: it acts while its tool's
    opening is less than the last number of `size`; the normal of what holds matter from all sides is 0.
    """

    surface: WarpFunction
    size: tuple[float, float, float, float]
    friction: float
    place: Vector = (0.0, 0.0, 0.0)
    turn: Quaternion = (1.0, 0.0, 0.0, 0.0)
    thin: bool = False
    side: int = 0
    grasps: bool = False


class Tool(Protocol):
    """A tool or a fixture."""

    @property
    def motion(self) -> Motion:
        """Kind of motion that its path gives it."""
        ...

    def primitives(self) -> tuple[Primitive, ...]:
        """Primitives that it consists of; they move together."""
        ...


@wp.func
def safe_norm(a: wp.vec3) -> float:
    """Length of a vector, at least `AXIS`, with a derivative everywhere."""
    return wp.sqrt(wp.dot(a, a) + AXIS * AXIS)


@wp.func
def rounded_box(p: wp.vec3, half: wp.vec3, radius: float):
    """Normal and signed distance of a box of half sides `half` with edges rounded by `radius`."""
    sign = wp.vec3(wp.where(p[0] < 0.0, -1.0, 1.0), wp.where(p[1] < 0.0, -1.0, 1.0), wp.where(p[2] < 0.0, -1.0, 1.0))
    q = wp.cw_mul(p, sign) - half + wp.vec3(radius, radius, radius)
    deepest = wp.max(q[0], wp.max(q[1], q[2]))
    n = wp.vec3()
    gap = deepest - radius
    if deepest > 0.0:
        beyond = wp.vec3(wp.max(q[0], 0.0), wp.max(q[1], 0.0), wp.max(q[2], 0.0))
        distance = safe_norm(beyond)
        n = wp.cw_mul(beyond / distance, sign)
        gap = distance - radius
    elif q[0] >= deepest:
        n = wp.vec3(sign[0], 0.0, 0.0)
    elif q[1] >= deepest:
        n = wp.vec3(0.0, sign[1], 0.0)
    else:
        n = wp.vec3(0.0, 0.0, sign[2])
    return n, gap
