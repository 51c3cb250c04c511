"""Command dead time: the arm does at t + d what it was told for t.

Transport and queueing, tens to hundreds of milliseconds. The tool is behind by d times its velocity.
"""

from app.core.geometry.track import Track
from app.discovery.sensor_actuator_errors.base import Apparatus, Load, Values, one


def _drive(track: Track, _load: Load, values: Values) -> Track:
    return Track(times_s=track.times_s + values[0], poses=track.poses)


EFFECT = Apparatus(
    family="actuation",
    parameters=one("command_delay", "s", 0.1, 0.5, "How much later than commanded the arm moves."),
    drive=_drive,
    told=True,
)
