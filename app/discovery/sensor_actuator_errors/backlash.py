"""Backlash: a dead band b. After a reversal the tool stands still until the gap is taken up (the play operator).

Nordin and Gutman 2002, "Controlling mechanical systems with backlash - a survey", eq. 2; 0.1 to 1 mm at the tip of an
arm that is new, more of one that is not. Along x and along y each.
"""

import numpy as np

from app.core.geometry.track import Track
from app.discovery.sensor_actuator_errors.base import Apparatus, Load, Values, one


def _drive(track: Track, _load: Load, values: Values) -> Track:
    half = float(values[0]) / 2
    poses = track.poses.copy()
    for axis in (0, 1):
        u = track.poses[:, axis]
        x = np.empty_like(u)
        x[0] = u[0]
        for k in range(1, len(u)):
            x[k] = min(max(x[k - 1], u[k] - half), u[k] + half)
        poses[:, axis] = x
    return Track(times_s=track.times_s, poses=poses)


EFFECT = Apparatus(
    family="actuation",
    parameters=one("backlash", "m", 0.002, 0.01, "Width of the dead band on reversal."),
    drive=_drive,
    told=True,
)
