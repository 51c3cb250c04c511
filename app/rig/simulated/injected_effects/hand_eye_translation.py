"""Hand-eye translation: the cameras are displaced from their calibration, so that everything seen is displaced by t."""

import numpy as np

from app.core.types import Transform
from app.rig.simulated.injected_effects.base import ANY_BODY, Hidden, Values, components, spatial
from app.rig.simulated.worlds.physics import Position


def _stands(T_world_camera: Transform, _middle: Position, values: Values) -> Transform:
    T = np.array(T_world_camera)
    T[:3, 3] -= values
    return T


HIDDEN = Hidden(
    family="sensing",
    bodies=ANY_BODY,
    quantities=components("hand_eye", "xyz", "m", 0.003, 0.02),
    draw=spatial,
    stands=_stands,
)
