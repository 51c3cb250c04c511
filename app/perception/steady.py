"""What depth cameras get wrong from one frame to the next, settled by the frame before.

A reading is believed where the frame before agrees with it, or where the colour has changed, too: then something moved.
Where the colour is the same, a reading that is missing is the former one, and one that jumps is neither: what flies
between an object and its background lies elsewhere every time, and glitter does not stay.
"""

from dataclasses import replace

import cv2
import numpy as np

from app.core.messages import Frame

JUMP_M = 0.006
"""More than two readings of one place differ: four standard deviations of their difference, at 0.75 m."""
_SAME_LEVELS = 20
"""So many of 255 the colour of a place may change that shows the same: noise, and what JPEG does."""


def steadied(frame: Frame, before: Frame | None) -> Frame:
    """The frame with readings that `before`, of the same camera, supports; the same where there is none to ask.

    What was missing in both stays missing. Both are frames as they were taken, so that nothing is carried on for more
    than one frame.
    """
    if before is None or before.depth.shape != frame.depth.shape:
        return frame
    still = cv2.absdiff(frame.color, before.color).max(axis=2) <= _SAME_LEVELS
    now, then = frame.depth, before.depth
    jumps = cv2.absdiff(now, then) > JUMP_M / frame.camera.depth_unit_m
    lost, doubtful = still & (now == 0), still & (now > 0) & (then > 0) & jumps
    depth = np.where(lost, then, np.where(doubtful, 0, now)).astype(now.dtype)
    return replace(frame, depth=depth)
