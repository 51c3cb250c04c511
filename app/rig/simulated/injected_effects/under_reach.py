"""Under-reach: the arm shortens every stroke, from where the tool came down, by the share k, or extends it."""

import numpy as np

from app.core.geometry.track import Track
from app.rig.simulated.injected_effects.base import ANY_BODY, Hidden, InjectedParameter, Values, with_random_sign

_DOWN_M = 0.004
"""Height above its lowest point below which the tool counts as down."""


def _drive(track: Track, values: Values) -> Track:
    positions = track.positions.copy()
    down = np.argmax(positions[:, 2] <= positions[:, 2].min() + _DOWN_M)
    positions[:, :2] -= values[0] * (positions[:, :2] - positions[down, :2])
    return track.with_positions(positions)


HIDDEN = Hidden(
    family="actuation",
    bodies=ANY_BODY,
    quantities=(InjectedParameter(name="under_reach", unit="1", typical=0.03, high=0.2),),
    draw=with_random_sign,
    drive=_drive,
    told=True,
)
