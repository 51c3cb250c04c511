"""Tool-centre-point offset: the tip is beside where the kinematics say, x_tip = x + R t, t in the tool's frame.

A finger that was mounted askew or is bent, 1 to 3 mm. It turns with the tool, which an error of the cameras does not:
where the tool never turns, the two cannot be told apart.
"""

from scipy.spatial.transform import Rotation

from app.core.geometry.track import Track
from app.discovery.sensor_actuator_errors.base import Apparatus, Load, Values, lengths


def _drive(track: Track, _load: Load, values: Values) -> Track:
    poses = track.poses.copy()
    poses[:, :3] += Rotation.from_quat(poses[:, 3:7], scalar_first=True).apply(values)
    return Track(times_s=track.times_s, poses=poses)


EFFECT = Apparatus(
    family="sensing",
    spelling=("tcp", "tool-centre-point"),
    parameters=lengths("tcp", 0.003, 0.02, "Offset of the tip in the tool's frame,", null_prior=(0.0, 0.04)),
    drive=_drive,
)
