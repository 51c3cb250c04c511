"""Under-reach: of every stroke the arm makes the share 1 - k, x = x0 + (1 - k) (u - x0) from where the motion began.

A gain that is not 1: gear ratio, link lengths, thermal growth. 0.5 to 3 % of the stroke, whatever the speed.
"""

from app.core.geometry.track import Track
from app.discovery.sensor_actuator_errors.base import Apparatus, Load, Values, one


def _drive(track: Track, _load: Load, values: Values) -> Track:
    poses = track.poses.copy()
    low = poses[:, 2] <= poses[:, 2].min() + 0.004
    start = poses[low][0, :2]
    poses[:, :2] = start + (1 - values[0]) * (poses[:, :2] - start)
    return Track(times_s=track.times_s, poses=poses)


EFFECT = Apparatus(
    family="actuation",
    spelling=("under_reach", "under-reach"),
    parameters=one("under_reach", "1", 0.03, 0.2, "Share of a stroke that is not made.", least=-0.2),
    drive=_drive,
    told=True,
)
