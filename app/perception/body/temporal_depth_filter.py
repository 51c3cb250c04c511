"""Temporal depth filter: errors between frames are corrected by the previous frame.

A reading is accepted where the previous frame agrees with it, or where the colour has changed as well: then something
moved. Where the colour is the same, a missing reading is replaced by the former one, and one that jumps is dropped:
flying pixels between an object and its background differ every time, and glitter does not stay.
"""

from dataclasses import replace

import cv2
import numpy as np

from app.core.messages import Frame

JUMP_M = 0.006
"""Largest difference between two readings of one surface: four standard deviations of it, at 0.75 m."""
_SAME_LEVELS = 20
"""Largest change of colour, of 255, of an unchanged surface: noise and JPEG compression."""


def filter_depth(frame: Frame, before: Frame | None) -> Frame:
    """The frame with the readings supported by `before`, of the same camera; unchanged where there is none.

    A reading missing in both stays missing. Both are raw frames, so that nothing is carried on for more than one frame.
    """
    if before is None or before.depth.shape != frame.depth.shape:
        return frame
    still = cv2.absdiff(frame.color, before.color).max(axis=2) <= _SAME_LEVELS
    now, then = frame.depth, before.depth
    jumps = cv2.absdiff(now, then) > JUMP_M / frame.camera.depth_unit_m
    lost, doubtful = still & (now == 0), still & (now > 0) & (then > 0) & jumps
    depth = np.where(lost, then, np.where(doubtful, 0, now)).astype(now.dtype)
    return replace(frame, depth=depth)
