"""Depth scale: every reading of the depth images is too long by the share s, or too short."""

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


def _scale_depth(shot: SensorImages, values: Values) -> DepthImage:
    return np.rint(shot.depth * (1.0 + values[0])).astype(np.uint16)


HIDDEN = Hidden(
    family="sensing",
    bodies=ANY_BODY,
    quantities=(InjectedParameter(name="depth_scale", unit="1", typical=0.008, high=0.05),),
    draw=with_random_sign,
    seen=_scale_depth,
)
