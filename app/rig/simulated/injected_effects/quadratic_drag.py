"""Quadratic drag: a thick fluid slows the object by q |v| v.

Not in the catalogue, whose film is linear; at 0.15 m/s the typical size is a fifth of the table's friction.
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
    plain,
)


def _force(moment: Moment, values: Values) -> Vectors:
    return acting(moment, -values[0] * np.linalg.norm(moment.v, axis=1, keepdims=True) * moment.v)


HIDDEN = Hidden(
    family="physics",
    bodies=SOLIDS,
    catalogued=False,
    quantities=(InjectedParameter(name="quadratic_drag", unit="1/m", typical=40.0, high=200.0),),
    draw=plain,
    force=_force,
)
