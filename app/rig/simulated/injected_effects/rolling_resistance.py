"""Rolling resistance: away from the tool, the object meets the share r of the table's friction.

This rope cannot roll about its axis (see `rope.py`), so the effect of rolling is modelled as friction: the ends trail
less, and the rope runs on after the finger has stopped. Of beans, it is the share of sliding and rolling friction.
"""

import numpy as np

from app.rig.simulated.injected_effects.base import ON_TABLES, Factors, Hidden, InjectedParameter, Moment, Values, plain

_REACH_M = 0.003
"""Gap between surfaces that counts as contact."""


def _friction(moment: Moment, values: Values) -> Factors:
    return np.where(moment.gap_m < _REACH_M, 1.0, values[0])


HIDDEN = Hidden(
    family="physics",
    bodies=ON_TABLES,
    quantities=(InjectedParameter(name="rolling_share", unit="1", null=1.0, typical=0.5, low=0.02, high=1.0),),
    draw=plain,
    friction=_friction,
)
