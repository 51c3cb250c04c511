"""Backlash: after every reversal, along x and along y each, the arm stands still for the width b of a gap."""

import numpy as np

from app.core.geometry.track import Track
from app.rig.simulated.injected_effects.base import ANY_BODY, Hidden, InjectedParameter, Values, plain


def _drive(track: Track, values: Values) -> Track:
    positions, half = track.positions.copy(), values[0] / 2
    for index in range(1, len(positions)):
        wanted = positions[index, :2]
        positions[index, :2] = np.clip(positions[index - 1, :2], wanted - half, wanted + half)
    return track.with_positions(positions)


HIDDEN = Hidden(
    family="actuation",
    bodies=ANY_BODY,
    quantities=(InjectedParameter(name="backlash", unit="m", typical=0.002, high=0.01),),
    draw=plain,
    drive=_drive,
    told=True,
)
