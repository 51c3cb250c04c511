"""Tool compliance: the tip gives way under load, x = u - F / k, by c = 1 / k metres a newton.

Hooke's law for finger, gripper and joints together; what bends beyond the arm's encoders it does not measure. Behind by
the same length at every speed, but only in contact.
"""

from app.core.geometry.track import Track
from app.discovery.sensor_actuator_errors.base import Apparatus, Load, Values, one
from app.sim.effects.base import ON_TABLES


def _drive(track: Track, load: Load, values: Values) -> Track:
    poses = track.poses.copy()
    poses[:, :3] += values[0] * load.forces
    return Track(times_s=track.times_s, poses=poses)


EFFECT = Apparatus(
    family="actuation",
    objects=ON_TABLES,
    parameters=one("tool_compliance", "m/N", 0.02, 0.2, "How far the tip gives way."),
    drive=_drive,
)
