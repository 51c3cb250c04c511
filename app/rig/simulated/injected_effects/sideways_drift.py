"""Sideways drift: a moving object is pulled to one side, by the share s of weight, as by a nap or a thread.

Not in the catalogue: the force is across the motion and does no work.
"""

import numpy as np

from app.rig.simulated.injected_effects.base import (
    SOLIDS,
    Hidden,
    InjectedParameter,
    Moment,
    Values,
    Vectors,
    acting,
    with_random_sign,
)

_REST_M_S = 5e-3
"""Speed far below which the pull is in proportion to it."""


def _force(moment: Moment, values: Values) -> Vectors:
    left = np.column_stack([-moment.v[:, 1], moment.v[:, 0], np.zeros(len(moment.v))])
    speed = np.sqrt((left**2).sum(1) + _REST_M_S**2)
    return acting(moment, values[0] * moment.gravity_m_s2 * left / speed[:, None])


HIDDEN = Hidden(
    family="physics",
    bodies=SOLIDS,
    catalogued=False,
    quantities=(InjectedParameter(name="sideways_drift", unit="1", typical=0.15, high=0.5),),
    draw=with_random_sign,
    force=_force,
)
