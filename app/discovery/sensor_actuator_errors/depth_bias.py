"""Depth bias: distances from the camera are too long by b, x_observed = x + b (x - c) / |x - c|.

An error of disparity that is the same everywhere, of a stereo head that was bent or warmed: 2 to 6 mm at 0.7 m.
"""

import numpy as np

from app.discovery.sensor_actuator_errors.base import Apparatus, Eye, Places, Values, one


def _see(points: Places, eye: Eye, values: Values) -> Places:
    ray = points - eye.position
    return points + values[0] * ray / np.linalg.norm(ray, axis=1, keepdims=True)


EFFECT = Apparatus(
    family="sensing",
    parameters=one("depth_bias", "m", 0.004, 0.02, "Length by which distances are seen too long.", least=-0.02),
    see=_see,
)
