"""Friction drift: the table's friction is 1 + d t times its own at the time t of the session, from -0.5 to 0.5."""

import numpy as np

from app.rig.simulated.injected_effects.base import (
    SOLIDS,
    Factors,
    Hidden,
    InjectedParameter,
    Moment,
    Values,
    with_random_sign,
)


def _friction(moment: Moment, values: Values) -> Factors:
    return np.full(len(moment.x), 1.0 + values[0] * moment.session)


HIDDEN = Hidden(
    family="physics",
    bodies=SOLIDS,
    quantities=(InjectedParameter(name="friction_drift", unit="1/session", typical=0.4, high=1.0),),
    draw=with_random_sign,
    friction=_friction,
)
