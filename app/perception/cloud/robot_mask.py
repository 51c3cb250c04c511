"""Robot mask: the pixels covered by the arm and its tool, by kinematics; readings there are not the object.

Every part is a convex piece, so it covers the convex hull of its projected corners in an image. Its pixels are kept
with its range of distances: a reading in front of or behind that is not of the arm, however wide the margin for errors
of kinematics and calibration.
"""

from collections.abc import Sequence
from typing import TypeAlias

import cv2
import numpy as np
from jaxtyping import Bool, Float32

from app.core.geometry.arm_geometry import ArmShape, JointState
from app.core.geometry.camera import CameraModel
from app.core.geometry.shapes.hulls import Corners, capsule_corners
from app.core.types import DepthImage

Shadow: TypeAlias = Float32[np.ndarray, "height width"]
"""Distance from the camera [m, along its axis] at which the arm begins in each pixel that shows it; infinite
elsewhere."""

MARGIN_M = 0.010
"""Margin of all parts: 5 mm of kinematics, 3 mm of extrinsics, a pixel, and cables."""
_NEAREST_M = 0.05


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
    """Convex pieces of the arm and its tool, enlarged by the margin but where the tool holds the object."""
    links = arm.links(at.joints)
    found = list[Corners]()
    for limb in arm.limbs:
        turn, place = links[limb.link][:3, :3], links[limb.link][:3, 3]
        begin, end = (turn @ np.asarray(place_m) + place for place_m in (limb.begin, limb.end))
        found += capsule_corners(begin, end, limb.radius_m + margin_m)
    return found + arm.tool.hulls(at.tool, margin_m)


def _beside(corners: Corners, camera: CameraModel) -> bool:
    """True where homogeneous pixels `(u z, v z, z)` are all beyond one side of the image, or behind the camera."""
    x, y, z = corners.T
    sides = (x < 0, x > camera.width * z, y < 0, y > camera.height * z, z < 0)
    return any(bool(side.all()) for side in sides)
