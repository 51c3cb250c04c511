"""Hand-eye rotation: the cameras look elsewhere than calibrated, x_observed = c + R (x - c) about the camera c.

Tsai and Lenz 1989, as for the translation; 0.2 to 1 degree. The table seems tilted, but nothing rolls off it.
"""

import numpy as np
from scipy.spatial.transform import Rotation

from app.discovery.sensor_actuator_errors.base import Apparatus, Eye, Places, Values
from app.sim.parameter import ParameterSpec


def _see(points: Places, eye: Eye, values: Values) -> Places:
    return eye.position + Rotation.from_rotvec(np.radians(values)).apply(points - eye.position)


EFFECT = Apparatus(
    family="sensing",
    spelling=("hand_eye", "hand-eye"),
    parameters=tuple(
        ParameterSpec(
            name=f"hand_eye_turn_{axis}",
            unit="deg",
            nominal=0.0,
            low=-3.0,
            high=3.0,
            typical=0.6,
            scale="linear",
            about=f"Turn of what the cameras see about {axis}, through the camera.",
        )
        for axis in "xyz"
    ),
    see=_see,
)
