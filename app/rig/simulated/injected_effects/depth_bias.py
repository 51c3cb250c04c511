"""Depth bias: distances along the rays of the depth images are too long by b, or too short."""

import numpy as np

from app.core.types import DepthImage
from app.rig.simulated.injected_effects.base import (
    ANY_BODY,
    Hidden,
    InjectedParameter,
    SensorImages,
    Values,
    with_random_sign,
)


def _bias_depth(shot: SensorImages, values: Values) -> DepthImage:
    camera = shot.camera
    v, u = np.indices(shot.depth.shape)
    rays = np.stack([u, v, np.ones_like(u)], axis=-1) @ np.linalg.inv(camera.K).T
    longer = values[0] / np.linalg.norm(rays, axis=-1) / camera.depth_unit_m
    return np.where(shot.depth > 0, np.rint(shot.depth + longer), 0).astype(np.uint16)


HIDDEN = Hidden(
    family="sensing",
    bodies=ANY_BODY,
    quantities=(InjectedParameter(name="depth_bias", unit="m", typical=0.004, high=0.02),),
    draw=with_random_sign,
    seen=_bias_depth,
)
