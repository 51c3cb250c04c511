"""Rolling resistance: where the finger does not touch, the rope meets the share r of the table's friction.

This rope cannot turn about itself (see `rope.py`), so what rolling would do is put in as friction: the ends trail less,
and the rope runs on after the finger has stopped.
"""

import numpy as np

from app.rig.simulated.hidden.base import Factors, Hidden, Moment, Quantity, Values, plain

_REACH_M = 0.003
"""From surface to surface, that counts as touched."""


def _friction(moment: Moment, values: Values) -> Factors:
    return np.where(moment.gap_m < _REACH_M, 1.0, values[0])


HIDDEN = Hidden(
    family="physics",
    quantities=(Quantity(name="rolling_share", unit="1", null=1.0, typical=0.5, low=0.02, high=1.0),),
    draw=plain,
    friction=_friction,
)
