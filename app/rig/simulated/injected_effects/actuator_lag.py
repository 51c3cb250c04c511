"""Actuator lag: the arm approaches its command at a rate in proportion to the remaining error, with time constant T.

Many small steps of x' = (u - x) / T, each a weighted mean of position and command.
"""

import numpy as np

from app.core.geometry.track import Track
from app.rig.simulated.injected_effects.base import ANY_BODY, Hidden, InjectedParameter, Values, plain

_STEP_S = 1e-3
_SETTLING = 5.0
"""Time constants after the command's end for which the arm is still followed."""


def _drive(track: Track, values: Values) -> Track:
    if values[0] == 0:
        return track
    sampled = _with_rest(track, _SETTLING * float(values[0]))
    parts = np.maximum(1, np.ceil(np.diff(sampled.times_s) / _STEP_S)).astype(int)
    x, positions = sampled.positions[0], [sampled.positions[0]]
    for index, count in enumerate(parts):
        step_s = (sampled.times_s[index + 1] - sampled.times_s[index]) / count
        left = np.exp(-step_s / values[0])
        for part in range(count):
            share = (part + 0.5) / count
            u = (1 - share) * sampled.positions[index] + share * sampled.positions[index + 1]
            x = u + (x - u) * left
        positions.append(x)
    return sampled.with_positions(np.array(positions))


def _with_rest(track: Track, by_s: float) -> Track:
    """The same track, resting at its end for `by_s`."""
    period_s = float(track.times_s[-1] - track.times_s[-2])
    more = track.times_s[-1] + period_s * np.arange(1, int(np.ceil(by_s / period_s)) + 1)
    rest = np.repeat(track.poses[-1:], len(more), axis=0)
    return Track(times_s=np.concatenate([track.times_s, more]), poses=np.concatenate([track.poses, rest]))


HIDDEN = Hidden(
    family="actuation",
    bodies=ANY_BODY,
    quantities=(InjectedParameter(name="actuator_lag", unit="s", typical=0.08, high=0.5),),
    draw=plain,
    drive=_drive,
    told=True,
)
