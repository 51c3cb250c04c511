"""Depth scale: distances from the camera are wrong by a share s, x_observed = c + (1 + s) (x - c).

Stereo depth is focal length times baseline over disparity: an error of the baseline is one of scale. Up to 2 % at 2 m
is what the makers of such cameras allow.
"""

from app.discovery.sensor_actuator_errors.base import Apparatus, Eye, Places, Values, one


def _see(points: Places, eye: Eye, values: Values) -> Places:
    return eye.position + (1 + values[0]) * (points - eye.position)


EFFECT = Apparatus(
    family="sensing",
    parameters=one("depth_scale", "1", 0.008, 0.05, "Share by which distances are seen too long.", least=-0.05),
    see=_see,
)
