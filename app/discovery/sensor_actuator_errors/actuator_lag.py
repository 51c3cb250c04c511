"""Actuator lag of first order: T dx/dt = u - x. Corners are cut, and the end is approached exponentially.

The closed position loop of a drive as its dominant pole (Franklin, Powell and Emami-Naeini, "Feedback Control of
Dynamic Systems", ch. 3); 30 to 100 ms. Integrated exactly for a command that is linear between its samples.
"""

import numpy as np

from app.core.geometry.track import Track
from app.discovery.sensor_actuator_errors.base import Apparatus, Load, Values, one

_LEAST_S = 1e-4


def _drive(track: Track, _load: Load, values: Values) -> Track:
    lag = float(values[0])
    if lag < _LEAST_S:
        return track
    poses = track.poses.copy()
    x, steps = poses[0, :3].copy(), np.diff(track.times_s)
    for index, h in enumerate(steps):
        u0, u1 = track.poses[index, :3], track.poses[index + 1, :3]
        slope, decay = (u1 - u0) / max(h, 1e-9), np.exp(-h / lag)
        x = u1 - slope * lag + (x - u0 + slope * lag) * decay
        poses[index + 1, :3] = x
    return Track(times_s=track.times_s, poses=poses)


EFFECT = Apparatus(
    family="actuation",
    parameters=one("actuator_lag", "s", 0.08, 0.5, "Time constant with which the arm follows its command."),
    drive=_drive,
    told=True,
)
