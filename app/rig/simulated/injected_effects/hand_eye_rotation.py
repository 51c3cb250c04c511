"""Hand-eye rotation: the frame that holds the cameras is turned, so that their images turn by R about their middle."""

import numpy as np
from scipy.spatial.transform import Rotation

from app.core.types import Transform
from app.rig.simulated.injected_effects.base import ANY_BODY, Hidden, Values, components, spatial
from app.rig.simulated.worlds.physics import Position


def _stands(T_world_camera: Transform, middle: Position, values: Values) -> Transform:
    back = Rotation.from_rotvec(-np.radians(values)).as_matrix()
    T = np.array(T_world_camera)
    T[:3, :3] = back @ T_world_camera[:3, :3]
    T[:3, 3] = middle + back @ (T_world_camera[:3, 3] - middle)
    return T


HIDDEN = Hidden(
    family="sensing",
    bodies=ANY_BODY,
    quantities=components("hand_eye_turn", "xyz", "deg", 0.6, 3.0),
    draw=spatial,
    stands=_stands,
)
