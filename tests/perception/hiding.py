"""Something in front of the cameras: in each image the pixels of a part of the world get another colour and depth."""

from collections.abc import Sequence
from dataclasses import replace

import cv2
import numpy as np

from app.core.messages import Frame
from app.perception.cloud.depth import project

SCREEN_RGB = (90, 95, 100)
_SCREEN_M = 0.30
"""Distance of the screen from each camera [m]: nearer than the table by far."""
_AROUND_PIXELS = 25


def screened(frames: Sequence[Frame], part: np.ndarray) -> list[Frame]:
    """The frames with a grey screen in front of the points `part (M, 3)` [m] and 25 pixels around them."""
    return [_screened(frame, _over(frame, part)) for frame in frames]


def touched(frames: Sequence[Frame], part: np.ndarray, **changes: int) -> list[Frame]:
    """The frames with another `depth` or `grey` over the points, to the pixel."""
    found = list[Frame]()
    for frame in frames:
        where = _over(frame, part, around=5)
        color, depth = frame.color.copy(), frame.depth.copy()
        if "grey" in changes:
            color[where] = changes["grey"]
        if "depth" in changes:
            depth[where] = changes["depth"]
        found.append(replace(frame, color=color, depth=depth))
    return found


def _screened(frame: Frame, where: np.ndarray) -> Frame:
    color, depth = frame.color.copy(), frame.depth.copy()
    color[where] = SCREEN_RGB
    depth[where] = round(_SCREEN_M / frame.camera.depth_unit_m)
    return replace(frame, color=color, depth=depth)


def _over(frame: Frame, part: np.ndarray, around: int = _AROUND_PIXELS) -> np.ndarray:
    column, row, _ = np.rint(project(part.astype(np.float32), frame.camera)).astype(int).T
    inside = (column >= 0) & (row >= 0) & (column < frame.camera.width) & (row < frame.camera.height)
    dots = np.zeros(frame.depth.shape, np.uint8)
    dots[row[inside], column[inside]] = 1
    return cv2.dilate(dots, np.ones((2 * around + 1, 2 * around + 1), np.uint8)) > 0
