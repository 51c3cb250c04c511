"""Hand-eye translation: the cameras are elsewhere than the calibration says, x_observed = x + t.

The translational error of AX = XB (Tsai and Lenz 1989, "A new technique for fully autonomous and efficient 3D robotics
hand/eye calibration"); 1 to 5 mm, 0.9 mm for a good automatic method. Contact seems to begin early or late.
"""

from app.discovery.sensor_actuator_errors.base import Apparatus, Eye, Places, Values, lengths


def _see(points: Places, _eye: Eye, values: Values) -> Places:
    return points + values


EFFECT = Apparatus(
    family="sensing",
    spelling=("hand_eye", "hand-eye"),
    parameters=lengths("hand_eye", 0.003, 0.02, "Offset of what the cameras see from where it is,"),
    see=_see,
)
