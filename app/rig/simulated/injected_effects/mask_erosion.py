"""Mask erosion: the object's pixels within e of its outline have no depth.

The outline in an image is that of the silhouette. Where cameras face the object from both sides, each sees in its
middle what the other loses, so the merged cloud loses less than e.
"""

import cv2
import numpy as np

from app.core.types import DepthImage
from app.rig.simulated.injected_effects.base import ANY_BODY, Hidden, InjectedParameter, SensorImages, Values, plain

_LIKE = 0.92
"""Cosine between colours from which on they count as the same in different light."""
_DARK = 30.0
_HALF_PX = 0.5
"""Distance from the centre of an edge pixel to the edge."""


def _erode_depth(shot: SensorImages, values: Values) -> DepthImage:
    wanted = np.array(shot.object_colour)
    colour = shot.color.astype(np.float64)
    strength = np.linalg.norm(colour, axis=-1)
    like = colour @ (wanted / np.linalg.norm(wanted)) > _LIKE * strength
    object_ = (like & (strength > _DARK)).astype(np.uint8)
    inside_px = cv2.distanceTransform(object_, cv2.DIST_L2, 5).astype(np.float64) - _HALF_PX
    inside_m = inside_px * shot.depth * shot.camera.depth_unit_m / shot.camera.K[0, 0]
    lost = (inside_px > 0) & (inside_m < values[0])
    return np.where(lost, 0, shot.depth).astype(np.uint16)


HIDDEN = Hidden(
    family="sensing",
    bodies=ANY_BODY,
    quantities=(InjectedParameter(name="mask_erosion", unit="m", typical=0.0015, high=0.004),),
    draw=plain,
    seen=_erode_depth,
)
