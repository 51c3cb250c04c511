"""Meshes of the objects in the cameras' view: tubes, boxes, bodies of revolution."""

from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float32, Float64, Int, UInt32
from scipy.interpolate import CubicSpline
from scipy.spatial import ConvexHull

from app.core.geometry.shapes.base import Colour, Vector

Vertices: TypeAlias = Float32[np.ndarray, "V 3"]
Triangles: TypeAlias = UInt32[np.ndarray, "F 3"]
Pieces: TypeAlias = Int[np.ndarray, "pieces corners"]

SIDES = 16
_RINGS_A_NODE = 3
_BOWL_RINGS = 10
_BALL_POINTS = 200
_SPIRAL = np.pi * (1 + 5**0.5) * np.arange(_BALL_POINTS)
_LEVELS = 1 - (2 * np.arange(_BALL_POINTS) + 1) / _BALL_POINTS
_BALL = np.stack([np.cos(_SPIRAL), np.sin(_SPIRAL), _LEVELS], axis=1)
_BALL[:, :2] *= np.sqrt(1 - _LEVELS[:, None] ** 2)
"""Points evenly on the unit sphere, by a golden spiral."""


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """A mesh of one colour (RGB albedo 0..1), in the world frame [m].

    Each of its `pieces` lists vertices whose convex hull contains a part of it; together they contain all of it.
    """

    vertices: Vertices
    triangles: Triangles
    pieces: Pieces
    colour: Colour


def tube(centreline: Float64[np.ndarray, "K 3"], radius_m: float, colour: Colour) -> Surface:
    """A smooth round tube along a cubic spline through `centreline`, with rounded caps."""
    at = np.linspace(0.0, len(centreline) - 1.0, (len(centreline) - 1) * _RINGS_A_NODE + 1)
    spline = CubicSpline(np.arange(len(centreline)), centreline)
    middle, along = spline(at), spline(at, 1)
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    middle, along, radii = _rounded_ends(middle, along, radius_m)
    # The rope lies on the table and is nowhere near vertical, so the world's z axis serves as its frame.
    side = np.cross(along, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return sweep(middle, side, np.cross(side, along), radii, colour)


def _rounded_ends(
    middle: Float64[np.ndarray, "R 3"], along: Float64[np.ndarray, "R 3"], radius_m: float
) -> tuple[Float64[np.ndarray, "Q 3"], Float64[np.ndarray, "Q 3"], Float64[np.ndarray, " Q"]]:
    """The rings with hemispheres of shrinking rings before the first and after the last."""
    angle = np.radians([88.0, 65.0, 40.0, 20.0])
    reach, shrunk = radius_m * np.sin(angle), radius_m * np.cos(angle)
    front = middle[0] - reach[:, None] * along[0]
    back = middle[-1] + reach[::-1, None] * along[-1]
    centres = np.concatenate([front, middle, back])
    directions = np.concatenate([np.tile(along[0], (4, 1)), along, np.tile(along[-1], (4, 1))])
    return centres, directions, np.concatenate([shrunk, np.full(len(middle), radius_m), shrunk[::-1]])


def body_of_revolution(
    heights: Float64[np.ndarray, " R"],
    radii: Float64[np.ndarray, " R"],
    frame: Float64[np.ndarray, "4 4"],
    colour: Colour,
) -> Surface:
    """A body of revolution about the z axis of `frame`."""
    middle = frame[:3, 3] + heights[:, None] * frame[:3, 2]
    rings = len(heights)
    return sweep(middle, np.tile(frame[:3, 0], (rings, 1)), np.tile(frame[:3, 1], (rings, 1)), radii, colour)


def sweep(
    middle: Float64[np.ndarray, "R 3"],
    side: Float64[np.ndarray, "R 3"],
    up: Float64[np.ndarray, "R 3"],
    radii: Float64[np.ndarray, " R"],
    colour: Colour,
) -> Surface:
    """Rings of `SIDES` vertices about `middle`, joined in order and closed by fans at both ends."""
    turn = np.linspace(0.0, 2 * np.pi, SIDES, endpoint=False)
    ring = np.cos(turn)[:, None] * side[:, None] + np.sin(turn)[:, None] * up[:, None]
    vertices = (middle[:, None] + radii[:, None, None] * ring).reshape(-1, 3)
    vertices = np.concatenate([vertices, middle[:1], middle[-1:]]).astype(np.float32)
    rings = np.arange(len(middle) * SIDES).reshape(-1, SIDES)
    pieces = np.concatenate([rings[:-1], rings[1:]], axis=1)
    return Surface(vertices=vertices, triangles=_ring_triangles(len(middle)), pieces=pieces, colour=colour)


def box(half_m: Vector, frame: Float64[np.ndarray, "4 4"], colour: Colour) -> Surface:
    """A box of these half sides about the origin of `frame`."""
    places = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(8, 3) * half_m
    sides = [(0, 1, 3, 2), (4, 6, 7, 5), (0, 4, 5, 1), (2, 3, 7, 6), (0, 2, 6, 4), (1, 5, 7, 3)]
    triangles = [corners for a, b, c, d in sides for corners in ((a, b, c), (a, c, d))]
    return Surface(
        vertices=(places @ frame[:3, :3].T + frame[:3, 3]).astype(np.float32),
        triangles=np.array(triangles, np.uint32),
        pieces=np.arange(8)[None],
        colour=colour,
    )


def sheet(knots: Float64[np.ndarray, "rows columns 3"], colour: Colour) -> Surface:
    """A two-sided surface without thickness through the `knots` of a square mesh, two triangles a cell."""
    rows, columns = knots.shape[:2]
    number = np.arange(rows * columns).reshape(rows, columns)
    a, b, c, d = (each.ravel() for each in (number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]))
    triangles = np.concatenate([np.stack([a, b, c], axis=1), np.stack([b, d, c], axis=1)])
    return Surface(
        vertices=knots.reshape(-1, 3).astype(np.float32),
        triangles=triangles.astype(np.uint32),
        pieces=np.stack([a, b, c, d], axis=1),
        colour=colour,
    )


def _ring_triangles(rings: int) -> Triangles:
    """Triangles between `rings` rings in order, then the fans; their winding does not matter to a ray."""
    k, j = np.meshgrid(np.arange(rings - 1), np.arange(SIDES), indexing="ij")
    a, b = k * SIDES + j, k * SIDES + (j + 1) % SIDES
    quads = np.stack([a, b, a + SIDES, b, b + SIDES, a + SIDES], axis=-1).reshape(-1, 3)
    rim = np.arange(SIDES)
    last = (rings - 1) * SIDES
    fans = [
        np.stack([np.full(SIDES, centre), start + rim, start + (rim + 1) % SIDES], axis=-1)
        for start, centre in ((0, rings * SIDES), (last, rings * SIDES + 1))
    ]
    return np.concatenate([quads, *fans]).astype(np.uint32)


def drops(middles: Float64[np.ndarray, "K 3"], radius_m: float, colour: Colour) -> Surface:
    """Many small balls: an icosahedron about each of `middles`, whose corners are `radius_m` away."""
    golden = (1 + 5**0.5) / 2
    corners = np.array([[0, a, b * golden] for a in (-1, 1) for b in (-1, 1)])
    corners = np.concatenate([np.roll(corners, turn, axis=1) for turn in range(3)]) / np.hypot(1, golden)
    faces = ConvexHull(corners).simplices
    first = np.arange(len(middles))[:, None, None] * len(corners)
    return Surface(
        vertices=(middles[:, None] + radius_m * corners).reshape(-1, 3).astype(np.float32),
        triangles=(first + faces).reshape(-1, 3).astype(np.uint32),
        pieces=np.arange(len(middles) * len(corners)).reshape(len(middles), -1),
        colour=colour,
    )


def lump(points: Float64[np.ndarray, "K 3"], skin_m: float, colour: Colour) -> Surface:
    """The convex hull of `points`, with its corners moved outward by `skin_m`."""
    hull = ConvexHull(points)
    away = points[hull.vertices] - points.mean(axis=0)
    away *= 1 + skin_m / np.linalg.norm(away, axis=1, keepdims=True)
    number = np.zeros(len(points), np.uint32)
    number[hull.vertices] = np.arange(len(hull.vertices))
    return Surface(
        vertices=(points.mean(axis=0) + away).astype(np.float32),
        triangles=number[hull.simplices],
        pieces=np.arange(len(away))[None],
        colour=colour,
    )


def hull(middles: Float64[np.ndarray, "K 3"], radius_m: float, colour: Colour) -> Surface:
    """Convex hull of balls about `middles`."""
    points = (middles[:, None] + radius_m * _BALL).reshape(-1, 3)
    found = ConvexHull(points)
    number = np.zeros(len(points), np.uint32)
    number[found.vertices] = np.arange(len(found.vertices))
    return Surface(
        vertices=points[found.vertices].astype(np.float32),
        triangles=number[found.simplices],
        pieces=np.arange(len(found.vertices))[None],
        colour=colour,
    )


def bowl(radius_m: float, thickness_m: float, frame: Float64[np.ndarray, "4 4"], colour: Colour) -> Surface:
    """Half of a hollow sphere about the origin of `frame`, open towards its z axis; `radius_m` is the inner one."""
    angle = np.linspace(np.pi / 2 * 0.999, 0.0, _BOWL_RINGS)
    outer, inner = radius_m + thickness_m, radius_m
    heights = np.concatenate([-outer * np.sin(angle), -inner * np.sin(angle[::-1])])
    radii = np.concatenate([outer * np.cos(angle), inner * np.cos(angle[::-1])])
    return body_of_revolution(heights, radii, frame, colour)
