"""Robot mask: the pixels covered by the arm and its tool, by kinematics; readings there are not the object.

Every part is a convex piece, so it covers the convex hull of its projected corners in an image. Its pixels are kept
with its range of distances: a reading in front of or behind that is not of the arm, however wide the margin for errors
of kinematics and calibration.
"""

import itertools
from collections.abc import Iterator, Sequence
from typing import TypeAlias

import cv2
import numpy as np
from jaxtyping import Bool, Float32, Float64
from scipy.spatial.transform import Rotation

from app.core.geometry.arm_geometry import ArmShape, JointState
from app.core.geometry.camera import CameraModel
from app.core.geometry.scene_description import Finger, Gripper, HeldBowl, Paddle, Tool
from app.core.types import DepthImage, ToolPose

Shadow: TypeAlias = Float32[np.ndarray, "height width"]
"""Distance from the camera [m, along its axis] at which the arm begins in each pixel that shows it; infinite
elsewhere."""
Corners: TypeAlias = Float64[np.ndarray, "_ 3"]
"""Points [m, world] whose convex hull contains a part."""

MARGIN_M = 0.010
"""Margin of all parts: 5 mm of kinematics, 3 mm of extrinsics, a pixel, and cables."""
_FINGER_M, _HANDLE_M = 0.10, 0.008
"""Distance from the tip of a tool to the hand, and radius of a paddle's handle."""
_NEAREST_M = 0.05
_TURNS, _RINGS = 12, 5
_OUTSIDE = 1.06
"""Scale of a ball's polyhedron that makes its inscribed corners enclose the ball."""


def shadow(camera: CameraModel, depth: DepthImage, pieces: Sequence[Corners]) -> Shadow:
    """Mask of the `pieces` in the camera's image, where `depth` agrees or has no reading.

    A piece that reaches behind the camera and is not beside its view covers everything: a camera touched by the arm.
    """
    begins = np.full(depth.shape, np.inf, np.float32)
    rotation, eye = camera.T_world_camera[:3, :3], camera.T_world_camera[:3, 3]
    for piece in pieces:
        corners = (piece - eye) @ rotation @ camera.K.T
        if _beside(corners, camera):
            continue
        near_m, far_m = float(corners[:, 2].min()), float(corners[:, 2].max())
        if near_m < _NEAREST_M:
            return np.zeros(depth.shape, np.float32)
        rows, columns, covered = _hull(corners, depth.shape)
        low, high = (np.float32(metres / camera.depth_unit_m) for metres in (near_m, far_m))
        measured, before = depth[rows, columns], begins[rows, columns]
        covered &= ((measured == 0) | ((measured >= low) & (measured <= high))) & (before > near_m)
        before[covered] = near_m
    return begins


def _hull(corners: Corners, shape: tuple[int, ...]) -> tuple[slice, slice, Bool[np.ndarray, "rows columns"]]:
    """Rows and columns of the bounding box of homogeneous pixels, and the mask of their hull in it."""
    pixels = np.rint(corners[:, :2] / corners[:, 2:]).astype(np.int32)
    (left, top), (right, bottom) = np.maximum(pixels.min(axis=0), 0), pixels.max(axis=0) + 1
    rows, columns = slice(top, max(min(bottom, shape[0]), top)), slice(left, max(min(right, shape[1]), left))
    covered = np.zeros((rows.stop - top, columns.stop - left), np.uint8)
    if covered.size:
        cv2.fillConvexPoly(covered, cv2.convexHull(pixels - np.array([left, top], np.int32)), (1,))
    return rows, columns, covered.astype(bool)


def pieces(arm: ArmShape, at: JointState, margin_m: float = MARGIN_M) -> list[Corners]:
    """Convex pieces of the arm and its tool, enlarged by the margin on every side."""
    links = arm.links(at.joints)
    found = list[Corners]()
    for limb in arm.limbs:
        turn, place = links[limb.link][:3, :3], links[limb.link][:3, 3]
        begin, end = (turn @ np.asarray(place_m) + place for place_m in (limb.begin, limb.end))
        found += _capsule(begin, end, limb.radius_m + margin_m)
    return found + list(_tool(arm.tool, at.tool, margin_m))


def _tool(tool: Tool, at: ToolPose, margin_m: float) -> Iterator[Corners]:
    """The tool's own pieces. Those that hold the object have no margin, and a bowl has none: it must stay visible."""
    turn, tip = Rotation.from_quat(at[3:7], scalar_first=True).as_matrix(), at[:3]
    up = -turn[:, 2]
    match tool:
        case Finger():
            sides = [tip + np.asarray(side) for side in tool.ends_m()]
            begin, end = ([side + height * up for side in sides] for height in (tool.radius_m, _FINGER_M))
            yield from _plate(begin, end, tool.radius_m + margin_m)
        case Paddle():
            yield _box(tool.half_m, turn, tip, margin_m)
            yield from _capsule(tip + tool.half_m[2] * up, tip + _FINGER_M * up, _HANDLE_M + margin_m)
        case Gripper():
            for side in (-1, 1):
                aside = side * (at[7] / 2 + tool.half_m[1])
                yield _box(tool.half_m, turn, tip + turn @ np.array([0.0, aside, -tool.half_m[2]]), 0.0)
        case HeldBowl():
            return


def _box(half_m: Sequence[float], turn: Float64[np.ndarray, "3 3"], middle: np.ndarray, margin_m: float) -> Corners:
    signs = np.stack(np.meshgrid(*[[-1.0, 1.0]] * 3, indexing="ij"), axis=-1).reshape(8, 3)
    return middle + signs * (np.asarray(half_m) + margin_m) @ turn.T


def _capsule(begin: np.ndarray, end: np.ndarray, radius_m: float) -> list[Corners]:
    return _plate([begin], [end], radius_m)


def _plate(begin: Sequence[np.ndarray], end: Sequence[np.ndarray], radius_m: float) -> list[Corners]:
    """Pieces of the volume within a radius of the sweep, no longer than thick: each has a nearest distance."""
    first, last = np.stack(begin), np.stack(end)
    count = max(1, int(np.ceil(np.linalg.norm(last[0] - first[0]) / (2 * radius_m))))
    places = first + np.linspace(0.0, 1.0, count + 1)[:, None, None] * (last - first)
    balls = places[:, :, None] + _OUTSIDE * radius_m * _BALL
    return [np.concatenate([*a, *b]) for a, b in itertools.pairwise(balls)]


def _beside(corners: Corners, camera: CameraModel) -> bool:
    """True where homogeneous pixels `(u z, v z, z)` are all beyond one side of the image, or behind the camera."""
    x, y, z = corners.T
    sides = (x < 0, x > camera.width * z, y < 0, y > camera.height * z, z < 0)
    return any(bool(side.all()) for side in sides)


def _ball() -> Float64[np.ndarray, "Q 3"]:
    """Points on the unit sphere: rings about the vertical, and the poles."""
    height = np.linspace(-1.0, 1.0, _RINGS + 2)[1:-1]
    around = np.linspace(0.0, 2 * np.pi, _TURNS, endpoint=False)
    z, turn = (each.ravel() for each in np.meshgrid(np.sin(np.pi / 2 * height), around, indexing="ij"))
    rim = np.sqrt(1 - z**2)
    rings = np.stack([rim * np.cos(turn), rim * np.sin(turn), z], axis=1)
    return np.concatenate([rings, [[0.0, 0.0, 1.0], [0.0, 0.0, -1.0]]])


_BALL = _ball()
