"""Mask erosion: segmentation loses a rim of width e all around the object (negative: it adds one).

Half a pixel to two, 0.5 to 3 mm at 0.7 m: mixed pixels at depth edges are thrown away, or colour bleeds. The object
looks thinner in every image, moving or not.
"""

import numpy as np

from app.discovery.sensor_actuator_errors.base import Apparatus, Eye, Places, Values, one
from app.sim.effects.base import ROPES

_LEAST_M = 1e-4


def _see(points: Places, eye: Eye, values: Values) -> Places:
    if (middle := eye.middle) is None:
        return points
    out = points - middle
    width = np.linalg.norm(out[:, :2], axis=1)
    share = values[0] / max(float(np.quantile(width, 0.95)), _LEAST_M)
    shrunk = points.copy()
    shrunk[:, :2] -= share * out[:, :2]
    return shrunk


EFFECT = Apparatus(
    family="sensing",
    objects=ROPES,
    parameters=one(
        "mask_erosion", "m", 0.0015, 0.004, "Width of the rim that is not seen.", least=-0.004, null_prior=(-0.29, 0.15)
    ),
    see=_see,
)
