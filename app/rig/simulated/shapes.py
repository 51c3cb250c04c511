"""What the cameras see that moves, as coloured meshes: the rope, the arm's links, the finger."""

from dataclasses import dataclass
from typing import TypeAlias, final

import numpy as np
from jaxtyping import Float32, Float64, UInt32
from scipy.interpolate import CubicSpline

from app.rig.simulated.arm_model import FOREARM_M, HAND_M, SHOULDER_M, UPPER_ARM_M, link_frames
from app.rig.simulated.world import Snapshot
from app.tasks.base import Finger, Rope

Vertices: TypeAlias = Float32[np.ndarray, "V 3"]
Triangles: TypeAlias = UInt32[np.ndarray, "F 3"]
Colour: TypeAlias = tuple[float, float, float]

SIDES = 16
_RINGS_A_NODE = 3
_FINGER_LENGTH_M = 0.10
_WHITE: Colour = (0.82, 0.83, 0.85)
_DARK: Colour = (0.13, 0.13, 0.15)


@final
@dataclass(frozen=True, kw_only=True, eq=False)
class Surface:
    """A closed mesh of one colour (RGB albedo 0..1), in the world frame [m].

    Its vertices are rings of `SIDES`, then the centres of the first and of the last ring; what lies between two
    neighbouring rings is convex.
    """

    vertices: Vertices
    triangles: Triangles
    colour: Colour


@final
@dataclass(frozen=True, kw_only=True)
class _Rod:
    """A straight tapered rod on the z axis of a link, `low` to `high` [m], as drawn."""

    link: int
    low: float
    high: float
    radius: float
    colour: Colour


_ARM = (
    _Rod(link=0, low=-SHOULDER_M, high=-SHOULDER_M + 0.12, radius=0.075, colour=_DARK),
    _Rod(link=0, low=-SHOULDER_M + 0.12, high=0.05, radius=0.06, colour=_WHITE),
    _Rod(link=1, low=0.0, high=UPPER_ARM_M / 2, radius=0.055, colour=_WHITE),
    _Rod(link=2, low=0.0, high=UPPER_ARM_M / 2 + 0.05, radius=0.05, colour=_WHITE),
    _Rod(link=3, low=0.0, high=FOREARM_M / 2, radius=0.045, colour=_WHITE),
    _Rod(link=4, low=0.0, high=FOREARM_M / 2 + 0.04, radius=0.042, colour=_WHITE),
    _Rod(link=6, low=-HAND_M / 2, high=-0.03, radius=0.04, colour=_WHITE),
    _Rod(link=6, low=-0.03, high=HAND_M / 2 - _FINGER_LENGTH_M, radius=0.032, colour=_DARK),
)


def surfaces(snapshot: Snapshot, rope: Rope, finger: Finger) -> list[Surface]:
    """Everything that moves, where it is in `snapshot`: the rope first."""
    frames = link_frames(snapshot.joints)
    parts = [tube(snapshot.centreline, rope.radius_m, rope.colour)]
    parts += [_placed(rod, frames[rod.link]) for rod in _ARM]
    parts.append(_placed_finger(finger, frames[7]))
    return parts


def tube(centreline: Float64[np.ndarray, "K 3"], radius_m: float, colour: Colour) -> Surface:
    """A smooth round tube along a cubic spline through `centreline`, closed by caps that round its ends off."""
    at = np.linspace(0.0, len(centreline) - 1.0, (len(centreline) - 1) * _RINGS_A_NODE + 1)
    spline = CubicSpline(np.arange(len(centreline)), centreline)
    middle, along = spline(at), spline(at, 1)
    along = along / np.linalg.norm(along, axis=1, keepdims=True)
    middle, along, radii = _rounded_ends(middle, along, radius_m)
    # The rope lies on the table and is nowhere near vertical, so the world's z axis serves as its frame.
    side = np.cross(along, [0.0, 0.0, 1.0])
    side /= np.linalg.norm(side, axis=1, keepdims=True)
    return _swept(middle, side, np.cross(side, along), radii, colour)


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


def _placed(rod: _Rod, frame: Float64[np.ndarray, "4 4"]) -> Surface:
    heights = np.array([rod.low, rod.low + 0.3 * rod.radius, rod.high - 0.3 * rod.radius, rod.high])
    radii = rod.radius * np.array([0.7, 1.0, 1.0, 0.7])
    return _turned(heights, radii, frame, rod.colour)


def _placed_finger(finger: Finger, tip: Float64[np.ndarray, "4 4"]) -> Surface:
    """The finger as the world has it: a capsule whose lowest point is the tip (the tip's z axis points down)."""
    angle = np.radians([0.0, 25.0, 50.0, 75.0, 88.0])
    heights = finger.radius_m * (np.sin(angle) - 1.0)
    heights, radii = np.concatenate([[-_FINGER_LENGTH_M], heights]), finger.radius_m * np.cos(angle)
    return _turned(heights, np.concatenate([[finger.radius_m], radii]), tip, _DARK)


def _turned(
    heights: Float64[np.ndarray, " R"],
    radii: Float64[np.ndarray, " R"],
    frame: Float64[np.ndarray, "4 4"],
    colour: Colour,
) -> Surface:
    """A body of revolution about the z axis of `frame`."""
    middle = frame[:3, 3] + heights[:, None] * frame[:3, 2]
    rings = len(heights)
    return _swept(middle, np.tile(frame[:3, 0], (rings, 1)), np.tile(frame[:3, 1], (rings, 1)), radii, colour)


def _swept(
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
    return Surface(vertices=vertices, triangles=_ring_triangles(len(middle)), colour=colour)


def _ring_triangles(rings: int) -> Triangles:
    """Triangles between `rings` rings in order, then the fans; their winding is of no account to a ray."""
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
