"""Conversion between depth images and points of the world.

Pixel coordinates count from the centre of the top left pixel, as OpenCV does: column `u` lies at
x = (u - cx) / fx * z in the optical frame (x right, y down, z forward).
"""

from typing import TypeAlias

import cv2
import numpy as np
from jaxtyping import Float

from app.core.colours import Mask
from app.core.geometry.camera import CameraModel
from app.core.types import Cloud, DepthImage

Pixels: TypeAlias = Float[np.ndarray, "M 3"]
"""Column, row [pixel] and depth [m]."""

_NO_READING = 0


def deproject(depth: DepthImage, mask: Mask, camera: CameraModel) -> Cloud:
    """The masked pixels that have a reading, as points [m] of the world, row by row."""
    rows, columns = np.nonzero(mask & (depth != _NO_READING))
    z = depth[rows, columns] * camera.depth_unit_m
    rotation, origin = camera.T_world_camera[:3, :3], camera.T_world_camera[:3, 3]
    # Axis by axis: linear algebra would use threads for so small a matrix, and take seven times as long.
    axes = zip(rotation @ np.linalg.inv(camera.K), origin, strict=True)
    return np.stack([(a * columns + b * rows + c) * z + at for (a, b, c), at in axes], axis=1).astype(np.float32)


def project(points: Cloud, camera: CameraModel) -> Pixels:
    """Projection of the world `points`, with their depth, which is not positive behind the camera."""
    rotation, origin = camera.T_world_camera[:3, :3], camera.T_world_camera[:3, 3]
    scaled = (points - origin) @ (camera.K @ rotation.T).T
    z = scaled[:, 2:]
    return np.concatenate([scaled[:, :2] / np.where(z > 0, z, np.nan), z], axis=1)


def behind_an_edge(depth: DepthImage, step_m: float, camera: CameraModel) -> Mask:
    """Mask of the pixels that lie more than `step_m` behind one of their neighbours.

    Beside the outline of an object a depth camera reports values between it and its background, on neither of them
    ("flying pixels"). The outline's own pixels are nearest and stay.
    """
    # Saturating, so that a missing reading lies behind nothing.
    return cv2.subtract(depth, nearest(depth)) > step_m / camera.depth_unit_m


def nearest(depth: DepthImage) -> DepthImage:
    """The smallest reading among each pixel and its eight neighbours, where there is one."""
    far = np.iinfo(depth.dtype).max
    smallest = cv2.erode(np.where(depth == _NO_READING, far, depth), np.ones((3, 3), np.uint8))
    return np.where(smallest == far, _NO_READING, smallest).astype(depth.dtype)
